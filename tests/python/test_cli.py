"""The command line as users meet it: what is written, what is said where, and with which exit code."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

import abbe
from abbe import doctor
from abbe.cli import frames
from abbe.cli import render as render_command
from abbe.cli import trace as trace_command

Run = Callable[..., subprocess.CompletedProcess[str]]
Slab = Callable[..., Path]


def said(result: subprocess.CompletedProcess[str], code: int, place: str) -> str:
    """Return the one line of an error, after checking code and place."""
    assert result.returncode == code, result.stderr
    lines = [line for line in result.stderr.splitlines() if not line.startswith("abbe: warning: ")]
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith(f"abbe: {place}"), lines[0]
    assert "Traceback" not in result.stderr
    return lines[0]


def leftovers(folder: Path) -> list[str]:
    """Return the files that are neither stages nor scenes."""
    return sorted(path.name for path in folder.iterdir() if path.suffix not in (".usda", ".safetensors"))


# Rendering


def test_render_writes_the_file_and_says_so(run: Run, slab: Slab, tmp_path: Path) -> None:
    result = run("render", slab(), "out.exr", "--width", "32", "--aov", "dispersion", "--aov", "primId")
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("out.exr: 2 AOVs, 512 pixels")
    assert leftovers(tmp_path) == ["out.exr"]


def test_one_is_singular(run: Run, slab: Slab) -> None:
    result = run("render", slab(), "out.exr", "--width", "32", "--aov", "ior", "--crop", "3,4,4,5")
    assert result.stdout.startswith("out.exr: 1 AOV, 1 pixel, "), result.stderr


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"),
        (0.000123456, "0.000123 s"),
        (0.0456, "0.0456 s"),
        (0.5, "0.500 s"),
        (0.9996, "1.00 s"),
        (12.345, "12.3 s"),
        (99.96, "100 s"),
        (12345.6, "12346 s"),
    ],
)
def test_times_have_three_digits(seconds: float, text: str) -> None:
    assert render_command._seconds(seconds) == text


def test_quiet_says_nothing(run: Run, slab: Slab) -> None:
    result = run("render", slab(), "out.exr", "--width", "32", "--quiet")
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


def test_products_name_the_files(run: Run, slab: Slab, tmp_path: Path) -> None:
    result = run("render", slab(a="a.exr", b="b.exr"))
    assert result.returncode == 0, result.stderr
    assert leftovers(tmp_path) == ["a.exr", "b.exr"]


def test_out_overrides_the_one_product(run: Run, slab: Slab, tmp_path: Path) -> None:
    result = run("render", slab(a="a.exr"), "mine.exr")
    assert result.returncode == 0, result.stderr
    assert leftovers(tmp_path) == ["mine.exr"]


def test_out_with_several_products_needs_one_chosen(run: Run, slab: Slab, tmp_path: Path) -> None:
    stage = slab(a="a.exr", b="b.exr")
    assert "--product" in said(run("render", stage, "mine.exr"), 2, "OUT mine.exr")
    assert leftovers(tmp_path) == []
    assert run("render", stage, "mine.exr", "--product", "/Render/b").returncode == 0
    assert leftovers(tmp_path) == ["mine.exr"]


def test_no_out_and_no_product_is_a_usage_error(run: Run, slab: Slab) -> None:
    said(run("render", slab()), 2, "OUT: is missing")


def test_two_products_do_not_overwrite_each_other(run: Run, slab: Slab, tmp_path: Path) -> None:
    said(run("render", slab(a="same.exr", b="same.exr")), 2, "same.exr")
    assert leftovers(tmp_path) == []


def test_usdrecord_names_are_understood(run: Run, slab: Slab, tmp_path: Path) -> None:
    stage = slab(a="a.exr")
    flags = ("--imageWidth", "32", "-cam", "Side", "-rs", "/Render/Settings", "--purposes", "render,proxy", "-f", "7")
    assert run("render", stage, "out.exr", *flags).returncode == 0
    plan = json.loads(run("plan", stage, "--json", "-w", "32", "--camera", "Side", "--defaultTime").stdout)
    assert plan[0]["camera_path"] == "/World/Side"
    assert plan[0]["resolution"] == [32, 16]


def test_same_bits_for_any_number_of_threads_and_from_an_exported_scene(
    run: Run, slab: Slab, tmp_path: Path, abbe_render: Path
) -> None:
    stage, scene, options = slab(), "scene.safetensors", ("--width", "50", "--samples", "4", "--quiet")
    assert run("export", stage, scene).returncode == 0
    assert run("render", stage, "one.exr", "--threads", "1", *options).returncode == 0
    assert run("render", stage, "two.exr", "--threads", "2", *options).returncode == 0
    assert run("render", scene, "scene.exr", *options).returncode == 0
    for out, flags in (("rust.exr", ()), ("mapped.exr", ("--mmap",))):
        result = subprocess.run([abbe_render, scene, out, *flags, *options], cwd=tmp_path, check=False)
        assert result.returncode == 0
    bytes_of = {name: (tmp_path / name).read_bytes() for name in leftovers(tmp_path)}
    assert len(bytes_of) == 5
    assert len(set(bytes_of.values())) == 1


def test_crops_and_sample_ranges_merge_to_the_same_bits(run: Run, slab: Slab, tmp_path: Path) -> None:
    stage, options = slab(), ("--width", "24", "--samples", "8", "--quiet")
    assert run("render", stage, "whole.exr", *options).returncode == 0
    parts = []
    for crop in ("0,0,10,12", "10,0,24,12"):
        for samples in ("0:4", "4:8"):
            part = f"part{len(parts)}.exr"
            result = run("render", stage, part, "--crop", crop, "--sample-range", samples, *options)
            assert result.returncode == 0, result.stderr
            parts.append(part)
    result = run("merge", *parts, "-o", "merged.exr")
    assert result.returncode == 0, result.stderr
    # Without a tolerance: the same bits.
    assert run("check", "merged.exr", "--against", "whole.exr").returncode == 0


def test_statistics_and_preview(run: Run, slab: Slab, tmp_path: Path) -> None:
    stage = slab(a="a.exr")
    result = run("render", stage, "out.exr", "--stats", "stats.json", "--preview", "look.png")
    assert result.returncode == 0, result.stderr
    stats = json.loads((tmp_path / "stats.json").read_text())
    assert stats["abbe"] == abbe.__version__
    assert stats["renders"][0]["output"] == "out.exr"
    assert stats["renders"][0]["complete"] is True
    assert stats["renders"][0]["frame"] == 7
    # With NumPy, USD and a film: some tens of megabytes at least, and no more than a machine has.
    assert 10e6 < stats["peak_memory_bytes"] < 1e12
    assert (tmp_path / "look.png").read_bytes().startswith(b"\x89PNG")
    assert leftovers(tmp_path) == ["look.png", "out.exr", "stats.json"]
    # All have the rights that the umask gives.
    (tmp_path / "plain").touch()
    rights = (tmp_path / "plain").stat().st_mode
    assert {name: (tmp_path / name).stat().st_mode for name in ("look.png", "stats.json")} == {
        "look.png": rights,
        "stats.json": rights,
    }


# Frames


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("5", [5.0]),
        ("1:4", [1.0, 2.0, 3.0, 4.0]),
        ("1:10x4", [1.0, 5.0, 9.0]),
        ("105:101", [105.0, 104.0, 103.0, 102.0, 101.0]),
        ("1-4", [1.0, 2.0, 3.0, 4.0]),
        ("1-10:3", [1.0, 4.0, 7.0, 10.0]),
        ("1,3,2:3", [1.0, 3.0, 2.0]),
        ("-2:0", [-2.0, -1.0, 0.0]),
        ("-4--2", [-4.0, -3.0, -2.0]),
        ("0.5:1.5x0.5", [0.5, 1.0, 1.5]),
    ],
)
def test_frame_lists(text: str, wanted: list[float]) -> None:
    assert frames.parse(text) == wanted


def test_a_fractional_stride_keeps_the_last_frame() -> None:
    assert len(frames.parse("0:1x0.1")) == 11
    assert len(frames.parse("0:1000x0.1")) == 10001


@pytest.mark.parametrize(
    "text", ["", "1:", ":", "a", "1:2x", "1:4x0", "1:4x-1", "4:1x1", "1,,2", "1:1e9", "0:9999999", "nan"]
)
def test_malformed_frame_lists_are_usage_errors(text: str) -> None:
    with pytest.raises(abbe.UsageError, match="--frames"):
        frames.parse(text)


def test_frame_names() -> None:
    assert frames.name_for("a.####.exr", 7.0, "OUT") == "a.0007.exr"
    assert frames.name_for("a.####.exr", -7.0, "OUT") == "a.-007.exr"
    assert frames.name_for("a.###.##.exr", 1.25, "OUT") == "a.001.25.exr"
    assert frames.name_for("a.exr", 7.0, "OUT") == "a.exr"
    for name, frame in (("a.##.exr", 1.5), ("a.##.exr", None), ("a.##.b.##.exr", 1.0)):
        with pytest.raises(abbe.UsageError, match="OUT"):
            frames.name_for(name, frame, "OUT")


def test_frames_are_rendered_to_their_own_files(run: Run, slab: Slab, tmp_path: Path) -> None:
    result = run("render", slab(), "f.##.exr", "-f", "7:9x2", "--width", "24", "--aov", "position", "--stats", "s.json")
    assert result.returncode == 0, result.stderr
    assert leftovers(tmp_path) == ["f.07.exr", "f.09.exr", "s.json"]
    assert (tmp_path / "f.07.exr").read_bytes() != (tmp_path / "f.09.exr").read_bytes()
    assert [render["frame"] for render in json.loads((tmp_path / "s.json").read_text())["renders"]] == [7, 9]


def test_frames_need_a_place_in_the_name(run: Run, slab: Slab, tmp_path: Path) -> None:
    said(run("render", slab(), "f.exr", "--frames", "1:2"), 2, "OUT f.exr")
    said(run("render", slab(a="a.exr"), "--frames", "1:2", "--preview", "p.png"), 2, "--preview p.png")
    assert leftovers(tmp_path) == []


# Bad input: one line with the place, the documented code, nothing left behind


BAD_OPTIONS = [
    (("--width", "0"), 2, "--width"),
    (("--width", "x"), 2, "--width"),
    (("--aov", "nonsense"), 2, "--aov nonsense"),
    (("--integrator", "differentials", "--aov", "color"), 2, "--aov color"),
    (("--integrator", "nonsense"), 2, "integrator 'nonsense'"),
    (("--samples", "0"), 2, "--samples"),
    (("--crop", "5,5,5,9"), 2, "--crop"),
    (("--crop", "1,2,3"), 2, "--crop"),
    (("--sample-range", "1:3"), 2, "--sample-range"),
    (("--band", "700:400"), 2, "--band"),
    (("--wavelength", "0.5876"), 2, "--wavelength"),
    (("--frames", "1:"), 2, "--frames"),
    (("--frames", "7", "--defaultTime"), 2, "--defaultTime"),
    (("--no-such-option",), 2, "unrecognized arguments"),
    (("--camera", "/World/Nobody"), 1, ""),
    (("--camera", "/World/Prism"), 1, "</World/Prism>"),
    (("--render-settings", "/Nowhere"), 1, ""),
    (("--set", "/World/Nobody.ior=2"), 1, "</World/Nobody>"),
    (("--set", "nonsense"), 2, "override 'nonsense'"),
    (("--variant", "nonsense"), 2, "variant 'nonsense'"),
]


@pytest.mark.parametrize(("flags", "code", "place"), BAD_OPTIONS, ids=lambda value: str(value))
def test_bad_options(run: Run, slab: Slab, tmp_path: Path, flags: tuple[str, ...], code: int, place: str) -> None:
    said(run("render", slab(), "out.exr", *flags), code, place)
    assert leftovers(tmp_path) == []


def test_bad_outputs(run: Run, slab: Slab, tmp_path: Path) -> None:
    stage = slab()
    said(run("render", stage, "out.png"), 2, "OUT out.png")
    said(run("render", stage, "nowhere/out.exr"), 1, "nowhere/out.exr")
    (tmp_path / "folder.exr").mkdir()
    said(run("render", stage, "folder.exr"), 2, "OUT folder.exr")
    said(run("render", stage, "out.exr", "--stats", "nowhere/s.json"), 1, "nowhere/s.json")
    assert leftovers(tmp_path) == ["folder.exr"]


def test_bad_stages(run: Run, slab: Slab, tmp_path: Path) -> None:
    said(run("render", "missing.usda", "out.exr"), 1, "missing.usda")
    (tmp_path / "text.usda").write_text("this is no stage")
    said(run("render", "text.usda", "out.exr"), 1, "text.usda")
    (tmp_path / "o.exr").write_bytes(b"v/1\x01 and more")
    line = said(run("plan", "o.exr"), 1, "o.exr: is not a USD file: name a .usd, .usda, .usdc or .usdz file")
    assert line.endswith("or an exported .safetensors scene")
    assert "safetensors" not in said(run("list-cameras", "o.exr"), 1, "o.exr: is not a USD file: name a .usd")
    (tmp_path / "o.exr").unlink()
    (tmp_path / "noise.safetensors").write_bytes(bytes(range(256)))
    said(run("render", "noise.safetensors", "out.exr"), 1, "noise.safetensors")
    for name, edit in {
        "index": ("[0, 1, 2, 3]", "[0, 1, 2, 4]"),
        "count": ("faceVertexCounts = [4]", "faceVertexCounts = [5]"),
        "nan": ("(9, 9, -4)", "(9, nan, -4)"),
    }.items():
        line = said(run("render", slab(f"{name}.usda", edit), "out.exr", "--strict"), 1, "")
        assert line.startswith("abbe: /World/Wall.") and "--strict" in line, line
        assert leftovers(tmp_path) == []
    # The rest of the picture is kept, and the culprit named.
    result = run("render", slab("index.usda", ("[0, 1, 2, 3]", "[0, 1, 2, 4]")), "out.exr", "--width", "16")
    assert result.returncode == 0
    assert "warning: /World/Wall.faceVertexIndices: index 3 is 4, but there are 4 points" in result.stderr


def test_an_old_file_survives_a_failed_render(run: Run, slab: Slab, tmp_path: Path) -> None:
    (tmp_path / "out.exr").write_bytes(b"old")
    assert run("render", slab(), "out.exr", "--aov", "nonsense").returncode == 2
    assert (tmp_path / "out.exr").read_bytes() == b"old"


def test_partial_output_has_its_own_code(run: Run, slab: Slab, tmp_path: Path) -> None:
    # The second product cannot be written where a folder appears in its place after the checks: a full disk's stand-in.
    stage = slab("broken.usda", ("9: (0.5, 0.2, 6)", "9: (nan, 0.2, 6)"))
    result = run("render", stage, "f.##.exr", "--frames", "7:9x2", "--width", "16", "--quiet")
    assert result.returncode == 3, result.stderr
    assert "f.07.exr" in result.stderr
    assert leftovers(tmp_path) == ["f.07.exr"]


def test_no_command_is_a_usage_error(run: Run) -> None:
    said(run(), 2, "")
    said(run("nonsense"), 2, "")


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signals_stop_at_once_and_leave_what_was_finished(slab: Slab, tmp_path: Path, sent: int, code: int) -> None:
    # Half a minute of work, if nobody stopped it.
    flags = ("--width", "4000", "--samples", "64", "--aov", "dispersion2", "--stats", "s.json")
    command = [sys.executable, "-m", "abbe", "render", str(slab()), "out.exr", *flags]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    time.sleep(3.0)
    assert process.poll() is None, "the render ended before the signal"
    process.send_signal(sent)
    begin = time.monotonic()
    _, told = process.communicate(timeout=60)
    assert process.returncode == code, told
    assert "Traceback" not in told
    assert "marked as partial" in told
    # Rendering stops within a tile; most of this is writing 8 million pixels.
    assert time.monotonic() - begin < 30.0
    assert leftovers(tmp_path) == ["out.exr"]


# Listings


def test_plan_tells_what_and_why(run: Run, slab: Slab) -> None:
    stage = slab(a="a.exr", b="b.exr")
    text = run("plan", stage).stdout
    assert "/Render/a" in text and "/Render/b" in text and "screen columns" in text
    plans = json.loads(run("plan", stage, "--json").stdout)
    assert [plan["output"] for plan in plans] == ["a.exr", "b.exr"]
    assert [layer["aov"] for layer in plans[0]["layers"]] == ["dispersion", "prim_id"]


def test_cameras_and_settings_are_listed(run: Run, slab: Slab) -> None:
    stage = slab(a="a.exr")
    cameras = json.loads(run("list-cameras", stage, "--json").stdout)
    assert [(camera["path"], camera["is_default"]) for camera in cameras] == [
        ("/World/Main", True),
        ("/World/Side", False),
    ]
    assert "/World/Main" in run("list-cameras", stage).stdout
    settings = json.loads(run("settings", stage, "--json").stdout)
    assert settings[0]["products"][0]["name"] == "a.exr"
    assert "prim_id: primId" in run("settings", stage).stdout


def test_aovs_are_listed(run: Run) -> None:
    listing = json.loads(run("aovs", "--json").stdout)
    names = [row["name"] for row in listing["aovs"]]
    assert "dispersion" in names
    depth = next(row for row in listing["aovs"] if row["name"] == "depth")
    assert "cameraDepth" in depth["aliases"] and depth["integrators"] == ["differentials", "path"]
    text = run("aovs").stdout
    assert all(name in text for name in names)


def test_trace_prints_every_event(run: Run, slab: Slab) -> None:
    stage = slab()
    told = json.loads(run("trace", stage, "--pixel", "15,10", "--width", "32", "--json").stdout)
    assert told["interfaces"] == len(told["events"]) >= 1
    text = run("trace", stage, "--pixel", "15,10", "--width", "32")
    assert text.returncode == 0, text.stderr
    assert "∂λ" in text.stdout and " refraction at (" in text.stdout
    assert not re.search(r"-0[,)]", text.stdout)
    said(run("trace", stage, "--pixel", "15", "--width", "32"), 2, "--pixel")
    said(run("trace", stage, "--pixel", "1,1", "--sample", "5"), 2, "--sample")


def test_traces_are_told_in_plain_words() -> None:
    for name in ("TotalReflection", "total_reflection"):
        assert trace_command._event_name(name) == "total reflection"
    assert trace_command._vector((-0.0, 0.0, -1e-12, 1 / 3)) == "(0, 0, -1e-12, 0.333333333)"


def test_doctor_finds_everything_well_here(run: Run) -> None:
    result = run("doctor", "--json")
    assert result.returncode == 0, result.stdout
    findings = {finding["what"]: finding for finding in json.loads(result.stdout)}
    assert {"abbe", "Python", "NumPy", "USD", "schemas", "OpenImageIO", "Pillow", "matplotlib"} <= findings.keys()
    assert findings["schemas"]["state"] == "ok"
    assert "USD" in run("doctor").stdout


def test_doctor_names_the_extra_of_everything_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    extras = {"USD": "usd", "MaterialX": "mtlx", "OpenImageIO": "check", "Pillow": "preview", "matplotlib": "plot"}
    for module in ("pxr", "pxr.Usd", "MaterialX", "OpenImageIO", "PIL", "matplotlib"):
        monkeypatch.delitem(sys.modules, module, raising=False)

    def find_spec(name: str, *_: object) -> None:
        if name in ("pxr", "MaterialX", "OpenImageIO", "PIL", "matplotlib"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(sys, "meta_path", [SimpleNamespace(find_spec=find_spec), *sys.meta_path])
    findings = {finding.what: finding for finding in doctor.examine()}
    for what, extra in extras.items():
        assert findings[what].state == "absent"
        assert findings[what].text.endswith(f"pip install 'abbe[{extra}]'")


def test_plugin_path_is_a_folder_that_usd_can_register(run: Run) -> None:
    folder = Path(run("plugin-path").stdout.strip())
    assert (folder / "plugInfo.json").is_file() and (folder / "generatedSchema.usda").is_file()


def test_check_accepts_ours_and_refuses_noise(run: Run, slab: Slab, tmp_path: Path) -> None:
    assert run("render", slab(), "out.exr", "--width", "32").returncode == 0
    result = run("check", "out.exr")
    assert result.returncode == 0, result.stdout + result.stderr
    assert run("check", "out.exr", "--against", "out.exr").returncode == 0
    (tmp_path / "noise.exr").write_bytes(b"noise")
    said(run("check", "noise.exr"), 1, "noise.exr: is not an EXR that abbe wrote: ")
    (tmp_path / "cut.exr").write_bytes((tmp_path / "out.exr").read_bytes()[:-100])
    result = run("check", "cut.exr")
    assert (result.returncode, len(result.stdout.splitlines()), result.stderr) == (4, 1, "")
    said(run("check", "missing.exr"), 1, "missing.exr")


def test_help_is_there_for_every_command(run: Run) -> None:
    overview = run("--help").stdout
    for command in (
        *("render", "plan", "export", "aovs", "list-cameras", "settings", "trace"),
        *("check", "merge", "doctor", "plugin-path"),
    ):
        assert command in overview
        assert run(command, "--help").returncode == 0
        # The stage is offered as a scene file where it may be one.
        takes_scenes = command in ("render", "plan", "export", "trace")
        assert ("an exported .safetensors scene" in " ".join(run(command, "--help").stdout.split())) == takes_scenes
    assert run("--version").stdout == f"abbe {abbe.__version__}\n"


def test_a_closed_pipe_is_no_disaster(tmp_path: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    result = subprocess.run(
        [sys.executable, "-m", "abbe", "aovs"], stdout=write, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(write)
    assert result.stderr == ""


# The program without Python


def test_abbe_render_speaks_the_same_language(run: Run, slab: Slab, tmp_path: Path, abbe_render: Path) -> None:
    def render(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([abbe_render, *arguments], cwd=tmp_path, capture_output=True, text=True, check=False)

    assert run("export", slab(a="a.exr", b="b.exr"), "two.safetensors").returncode == 0
    assert render("two.safetensors", "--stats", "s.json", "--quiet").returncode == 0
    assert leftovers(tmp_path) == ["a.exr", "b.exr", "s.json"]
    assert len(json.loads((tmp_path / "s.json").read_text())["renders"]) == 2
    said(render("two.safetensors", "mine.exr"), 2, "OUT mine.exr")
    assert render("two.safetensors", "mine.exr", "--product", "/Render/a").returncode == 0
    assert (tmp_path / "mine.exr").read_bytes() == (tmp_path / "a.exr").read_bytes()
    said(render("missing.safetensors", "x.exr"), 1, "missing.safetensors")
    said(render("two.safetensors", "x.exr", "--product", "/Render/a", "--aov", "nonsense"), 2, "--aov nonsense")
    said(render(), 2, "SCENE")
    process = subprocess.Popen(
        [abbe_render, "two.safetensors", "big.exr", "--product", "/Render/a", "--width", "6000", "--samples", "64"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
    )
    time.sleep(1.5)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130, told
    assert (tmp_path / "big.exr").is_file() == ("marked as partial" in told)
