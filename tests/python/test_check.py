"""`abbe check`: a sound file passes, every kind of damage is found with file, channel and pixel."""

import json
import sys

import numpy as np
import pytest
import sample_exr
from sample_exr import TABLE

from abbe.check import check
from abbe.errors import AbbeError

pytest.importorskip("OpenImageIO", reason="the check opens files with OpenImageIO")


def run(tmp_path, change=None, *, name="out.exr", **options):
    """Check a sound file after `change(channels, header)`."""
    channels, header = sample_exr.sound()
    if change is not None:
        change(channels, header)
    path = tmp_path / name
    sample_exr.write(path, channels, header)
    return check(path, aovs=TABLE, **options)


def test_a_sound_file_passes(tmp_path):
    report = run(tmp_path)
    assert report.passed, str(report)
    assert report.failures == []
    assert [layer.name for layer in report.layers] == [row["name"] for row in TABLE]
    ior = next(layer for layer in report.layers if layer.name == "ior")
    assert ior.minimum == ior.maximum == np.float32(1.5168)
    assert 0 < ior.valid < 1
    assert report.window == (0, 0, 40, 24)
    assert report.compression == "none"
    assert "ok" in str(report).splitlines()[0]
    json.dumps(report.to_dict(), allow_nan=False)


# Pixel 20,12 lies in the ball, 0,0 outside.
def put(channel, value, at=(20, 12)):
    def change(channels, header):
        channels[channel][at[1], at[0]] = value

    return change


def put_all(value, *names):
    def change(channels, header):
        for name in names:
            channels[name][12, 20] = value

    return change


@pytest.mark.parametrize(
    ("change", "channel", "pixel", "words"),
    [
        (put("dispersion.X", np.nan), "dispersion.X", (20, 12), "NaN"),
        (put("dispersion.Y", -np.inf), "dispersion.Y", (20, 12), "infinite"),
        (put("depth.valid", np.nan), "depth.valid", (20, 12), "NaN"),
        (put("ior.valid", 1.25), "ior.valid", (20, 12), "0..1"),
        (put("ior.valid", -0.25), "ior.valid", (20, 12), "0..1"),
        (put("ior.X", 1.5, at=(0, 0)), "ior.X", (0, 0), "must be 0 where valid is 0"),
        (put("ior.X", 0.0), "ior.X", (20, 12), "above 0"),
        (put("ior.X", -1.5), "ior.X", (20, 12), "above 0"),
        (put("dispersion_footprint.X", -1e-3), "dispersion_footprint.X", (20, 12), "below 0"),
        (put("footprint_half_width.X", 150.1), "footprint_half_width.X", (20, 12), "half the band"),
        (put_all(-1.0, "depth.Z", "Z"), "depth.Z", (20, 12), "below 0"),
        (put("Z", 7.0), "Z", (20, 12), "depth"),
        (put_all(1.0, "normal.X", "normal.Y"), "normal.X", (20, 12), "longer than 1"),
        (put_all(0.1, "normal.X", "normal.Y", "normal.Z"), "normal.X", (20, 12), "length 1"),
        (put("interfaces.I", 65), "interfaces.I", (20, 12), "64"),
        (put("total_reflections.I", 3), "total_reflections.I", (20, 12), "number of interfaces"),
        (put("prim_id.I", 3), "prim_id.I", (20, 12), "2 paths"),
    ],
)
def test_values_that_cannot_be_are_found_at_their_pixel(tmp_path, change, channel, pixel, words):
    report = run(tmp_path, change)
    found = [failure for failure in report.failures if failure.channel == channel and words in failure.message]
    assert len(found) == 1, str(report)
    assert found[0].pixel == pixel
    assert not report.passed
    assert str(tmp_path / "out.exr") in str(report)
    assert channel in str(report)


def test_pixels_are_those_of_the_full_raster_and_counted(tmp_path):
    channels, header = sample_exr.sound()
    channels["dispersion.X"][3:5, 7:9] = np.nan
    sample_exr.write(tmp_path / "crop.exr", channels, header, origin=(100, 50), raster=(640, 480))
    report = check(tmp_path / "crop.exr", aovs=TABLE)
    nan = next(failure for failure in report.failures if "NaN" in failure.message)
    assert (nan.pixel, nan.count) == ((107, 53), 4)
    assert report.window == (100, 50, 140, 74)


def test_mean_normals_may_be_shorter_than_one(tmp_path):
    def change(channels, header):
        put_all(0.1, "normal.X", "normal.Y", "normal.Z")(channels, header)
        header["abbe:sampleRange"] = "0:4:4"

    assert run(tmp_path, change).passed


@pytest.mark.parametrize(
    ("attribute", "value", "words"),
    [
        *(
            (name, None, f"no attribute {name}")
            for name in sample_exr.HEADER
            if "anifest" not in name and "als" not in name
        ),
        ("abbe:referenceWavelength", 100.0, "360"),
        ("abbe:referenceWavelength", "587.5618", "not int or float"),
        ("abbe:referenceWavelengthText", "500 nm", "587.5618"),
        ("abbe:band", "700:400 nm", "low:high"),
        ("abbe:metersPerUnit", 0.0, "positive"),
        ("abbe:upAxis", "X", "Y or Z"),
        ("abbe:sampleRange", "1:1:1", "begin:end:total"),
        ("abbe:materials", "{", "JSON"),
        ("abbe:primManifest", None, "primManifest"),
        ("abbe:primManifest", "{", "primManifest"),
        ("abbe:unit:ior", "nm", "abbe:unit:ior"),
        ("abbe:unit:ior", None, "abbe:unit:ior"),
        ("abbe:layers", None, "abbe:layers"),
        ("abbe:layers", "[1]", "abbe:layers"),
    ],
)
def test_headers_that_say_too_little_or_nonsense_fail(tmp_path, attribute, value, words):
    def change(channels, header):
        del header[attribute]
        if value is not None:
            header[attribute] = value

    report = run(tmp_path, change)
    assert any(words in str(failure) for failure in report.failures), str(report)


def test_channels_follow_the_table(tmp_path):
    def change(channels, header):
        del channels["dispersion.Y"], channels["uv.valid"]
        channels["ior.X"] = channels["ior.X"].astype(np.uint32)
        channels["prim_id.I"] = channels["prim_id.I"].astype(np.float32)
        channels["stray.X"] = channels["depth.Z"]

    text = str(run(tmp_path, change))
    for words in [
        "channel dispersion.Y: is missing",
        "channel uv.valid: is missing",
        "channel ior.X: is stored as uint32",
        "channel prim_id.I: is stored as float32",
        "channel stray.X: belongs to no layer",
    ]:
        assert words in text, text


def test_layers_may_have_names_of_their_own(tmp_path):
    def change(channels, header):
        for suffix in ("X", "Y", "valid"):
            channels[f"bend.{suffix}"] = channels.pop(f"dispersion.{suffix}")
        for suffix in ("U", "V", "valid"):
            channels[suffix] = channels.pop(f"uv.{suffix}")
        renamed = {"dispersion": "bend", "uv": ""}
        layers = [{"name": renamed.get(row["name"], row["name"]), "aov": row["name"]} for row in TABLE]
        header["abbe:layers"] = json.dumps(layers)
        header["abbe:unit:bend"] = header.pop("abbe:unit:dispersion")

    report = run(tmp_path, change)
    assert report.passed, str(report)
    assert "bend = dispersion" in str(report)


def test_exact_sums_of_a_part_are_checked(tmp_path):
    def change(channels, header):
        header["abbe:sampleRange"] = "0:2:4"
        sums = np.where(channels["depth.valid"] > 0, 2.0 * channels["depth.Z"].astype(np.float64), 0.0)
        bits = sums.view(np.uint64)
        channels["abbe_partial.depth.Z_hi"] = (bits >> np.uint64(32)).astype(np.uint32)
        channels["abbe_partial.depth.Z_lo"] = (bits & np.uint64(0xFFFFFFFF)).astype(np.uint32)
        channels["abbe_partial.depth.count"] = 2 * channels["depth.valid"].astype(np.uint32)

    assert run(tmp_path, change).passed

    def damage(channels, header):
        change(channels, header)
        channels["abbe_partial.depth.Z_hi"][12, 20] = 0x7FF80000
        channels["abbe_partial.depth.count"][12, 21] = 3

    text = str(run(tmp_path, damage))
    assert "abbe_partial.depth.Z_hi, pixel 20,12: the sum is not finite" in text
    assert "abbe_partial.depth.count, pixel 21,12: must not exceed the 2 samples" in text


def test_files_that_do_not_open_fail(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.exr"):
        check(tmp_path / "none.exr", aovs=TABLE)
    with pytest.raises(AbbeError, match="is a folder"):
        check(tmp_path, aovs=TABLE)
    run(tmp_path)
    for name, content in (("text.exr", b"no image"), ("empty.exr", b""), ("ball.png", b"\x89PNG\r\n\x1a\n")):
        (tmp_path / name).write_bytes(content)
        for path, against in ((name, "out.exr"), ("out.exr", name)):
            with pytest.raises(AbbeError, match=f"{name}: is not an EXR that abbe wrote"):
                check(tmp_path / path, against=tmp_path / against, aovs=TABLE)
    (tmp_path / "head.exr").write_bytes((tmp_path / "out.exr").read_bytes()[:40])
    report = check(tmp_path / "head.exr", aovs=TABLE)
    assert not report.passed
    assert str(report).startswith(f"{tmp_path / 'head.exr'}: OpenImageIO cannot open it: ")
    assert len(str(report).splitlines()) == 1
    whole = (tmp_path / "out.exr").read_bytes()
    (tmp_path / "cut.exr").write_bytes(whole[: len(whole) - 200])
    assert not check(tmp_path / "cut.exr", aovs=TABLE).passed


def test_a_file_of_other_software_is_one_fault(tmp_path):
    channels, header = sample_exr.sound()
    path = tmp_path / "other.exr"
    sample_exr.write(path, channels, {"software": "Nuke"})
    report = check(path, aovs=TABLE)
    assert not report.passed
    (line,) = str(report).splitlines()
    assert line.startswith(f"{path}: is not an EXR that abbe wrote: ")
    # Such a file can still be compared.
    sample_exr.write(tmp_path / "same.exr", channels, header)
    assert all(d.passed for d in check(path, against=tmp_path / "same.exr", aovs=TABLE).differences)


def test_without_openimageio_the_extra_is_named(tmp_path, monkeypatch):
    (tmp_path / "out.exr").touch()
    monkeypatch.setitem(sys.modules, "OpenImageIO", None)
    with pytest.raises(AbbeError, match=r"pip install 'abbe\[check\]'"):
        check(tmp_path / "out.exr", aovs=TABLE)


def test_equal_files_do_not_differ(tmp_path):
    run(tmp_path, name="reference.exr")
    report = run(tmp_path, against=tmp_path / "reference.exr")
    assert report.passed, str(report)
    assert all(d.maximum == d.rms == d.mean == d.differing == 0 and d.worst is None for d in report.differences)


def test_differences_are_measured_per_layer(tmp_path):
    def rounded(channels, header):
        # Multiples of 1/64, so that differences are exact.
        for name in ("dispersion.X", "dispersion.Y"):
            channels[name][:] = np.round(64 * channels[name]) / 64
            reference[name] = channels[name].copy()

    reference = {}
    run(tmp_path, rounded, name="reference.exr")

    def change(channels, header):
        rounded(channels, header)
        channels["dispersion.X"][12, 20] = reference["dispersion.X"][12, 20] + 0.5
        channels["dispersion.Y"][13, 21] = reference["dispersion.Y"][13, 21] - 0.25
        channels["uv.U"][12, 20] = np.nextafter(channels["uv.U"][12, 20], np.float32(9))
        channels["prim_id.I"][12, 20] = 2

    report = run(tmp_path, change, against=tmp_path / "reference.exr")
    by_layer = {d.layer: d for d in report.differences}
    dispersion = by_layer["dispersion"]
    n = 3 * sample_exr.WIDTH * sample_exr.HEIGHT
    assert dispersion.maximum == 0.5
    assert dispersion.mean == pytest.approx(0.75 / n, rel=1e-6)
    assert dispersion.rms == pytest.approx(((0.25 + 0.0625) / n) ** 0.5, rel=1e-6)
    assert (dispersion.differing, dispersion.worst) == (2, (20, 12))
    assert not by_layer["uv"].passed
    assert not by_layer["prim_id"].passed
    assert by_layer["ior"].passed
    assert not report.passed
    assert "DIFFERS" in str(report)
    json.dumps(report.to_dict(), allow_nan=False)

    report = run(tmp_path, change, against=tmp_path / "reference.exr", tolerance=0.5)
    assert {d.layer for d in report.differences if not d.passed} == {"prim_id"}
    report = run(tmp_path, change, against=tmp_path / "reference.exr", relative_tolerance=1e-6)
    assert {d.layer for d in report.differences if not d.passed} == {"dispersion", "prim_id"}


def test_signed_zeros_are_other_bits(tmp_path):
    run(tmp_path, name="reference.exr")
    report = run(tmp_path, put("dispersion.X", -0.0, at=(0, 0)), against=tmp_path / "reference.exr")
    dispersion = next(d for d in report.differences if d.layer == "dispersion")
    assert (dispersion.differing, dispersion.maximum, dispersion.worst) == (1, 0.0, (0, 0))


def test_a_nan_differs_from_a_number(tmp_path):
    run(tmp_path, name="reference.exr")
    report = run(tmp_path, put("uv.U", np.nan), against=tmp_path / "reference.exr", tolerance=1e30)
    assert not next(d for d in report.differences if d.layer == "uv").passed


def test_other_layers_or_windows_fail(tmp_path):
    run(tmp_path, name="reference.exr")

    def change(channels, header):
        for suffix in ("X", "valid"):
            del channels[f"ior.{suffix}"]
        header["abbe:layers"] = json.dumps([e for e in json.loads(header["abbe:layers"]) if e["name"] != "ior"])

    report = run(tmp_path, change, against=tmp_path / "reference.exr")
    assert any("`ior`" in failure.message and "out.exr" in failure.message for failure in report.failures), str(report)

    channels, header = sample_exr.sound()
    sample_exr.write(tmp_path / "moved.exr", channels, header, origin=(1, 0), raster=(50, 24))
    report = check(tmp_path / "moved.exr", against=tmp_path / "reference.exr", aovs=TABLE)
    assert any("data window" in failure.message for failure in report.failures)


def test_tolerances_are_numbers(tmp_path):
    for bad in (-1.0, float("nan")):
        with pytest.raises(ValueError, match="tolerance"):
            run(tmp_path, tolerance=bad)
