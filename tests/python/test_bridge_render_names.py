"""Frame tokens in product names, in the spellings of usdrecord, RenderMan, Houdini, Arnold and C."""

import pytest

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from abbe.frame_tokens import expand_frame_tokens


@pytest.mark.parametrize(
    ("name", "frame", "expected"),
    [
        ("a.exr", 7, "a.exr"),
        ("a.####.exr", 7, "a.0007.exr"),
        ("a.#.exr", 107, "a.107.exr"),
        ("a.###.##.exr", 7.25, "a.007.25.exr"),
        ("a.<F>.exr", 7, "a.7.exr"),
        ("a.<F4>.exr", 7, "a.0007.exr"),
        ("a.<FF>.exr", 7.25, "a.7.25.exr"),
        ("a.<FF>.exr", 7, "a.7.exr"),
        ("a.$F.exr", 7, "a.7.exr"),
        ("a.$F4.exr", 7.75, "a.0007.exr"),
        ("a.$FF.exr", 7.25, "a.7.25.exr"),
        ("a${F4}b.exr", 7, "a0007b.exr"),
        ("a_$F4_b.exr", 7, "a_0007_b.exr"),
        ("a_$F_b.exr", 7, "a_7_b.exr"),
        ("a.%04d.exr", 7, "a.0007.exr"),
        ("a.%d.exr", 7, "a.7.exr"),
        ("a.%g.exr", 7.5, "a.7.5.exr"),
        ("a.%04d.exr", -7, "a.-007.exr"),
        ("$FOLDER/a.exr", 7, "$FOLDER/a.exr"),
        ("50%.exr", 7, "50%.exr"),
        ("a.<OS>.<N>.exr", 7, "a.Beauty.2.exr"),
        ("a.$F4.exr", 123456, "a.123456.exr"),
    ],
)
def test_frame_tokens_are_replaced(name, frame, expected):
    assert expand_frame_tokens(name, frame, "Beauty", 2) == expected
