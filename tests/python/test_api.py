"""The Python interface: arrays without copies, memory that outlives its owner, interruption, the optics alone."""

import gc
import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import abbe
from abbe import _core
from abbe._api import warning_lines

Slab = Callable[..., Path]


# Films


def test_film_layers_are_views(slab: Slab) -> None:
    film = abbe.render(slab(), width=48, aovs=["dispersion", "primId", "depth"])
    assert film.names() == list(film) == ["dispersion", "prim_id", "depth"]
    assert len(film) == 3 and "dispersion" in film and "ior" not in film
    assert film.resolution == (48, 24) and film.window == (0, 0, 48, 24)
    dispersion, ids = film["dispersion"], film["prim_id"]
    assert (dispersion.shape, dispersion.dtype) == ((24, 48, 2), np.float32)
    assert (ids.shape, ids.dtype) == ((24, 48, 1), np.uint32)
    for array in (dispersion, ids):
        assert array.flags.c_contiguous and not array.flags.writeable and not array.flags.owndata
        assert array.base is film
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
        with pytest.raises(ValueError, match="WRITEABLE"):
            array.flags.writeable = True
    assert np.shares_memory(dispersion, film["dispersion"])
    assert np.any(dispersion != 0.0)


def test_a_layer_outlives_every_name_of_its_film(slab: Slab) -> None:
    film = abbe.render(slab(), width=48, aovs=["position"])
    view, copy = film["position"][3:9], np.array(film["position"][3:9])
    del film
    gc.collect()
    # Something else gets the chance to use the memory.
    np.ones(1 << 20, dtype=np.float32)
    np.testing.assert_array_equal(view, copy)


def test_validity_and_aliases(slab: Slab) -> None:
    film = abbe.render(slab(), width=48, samples=4, aovs=["abbe_number", "prim_id"])
    valid = film.valid("abbe_number")
    assert valid is not None
    assert (valid.shape, valid.dtype) == ((24, 48), np.float32)
    assert not valid.flags.writeable
    assert set(np.unique(valid)) <= {0.0, 0.25, 0.5, 0.75, 1.0}
    number = film["abbe_number"][valid == 1.0]
    assert number.size > 0
    np.testing.assert_allclose(number, 64.17, rtol=1e-6)
    assert np.all(film["abbe_number"][valid == 0.0] == 0.0)
    assert film.valid("prim_id") is None
    np.testing.assert_array_equal(film["primId"], film["prim_id"])
    with pytest.raises(KeyError, match="'ior' was not rendered: this film has abbe_number, prim_id"):
        film["ior"]


def test_statistics_and_metadata_are_plain_values(slab: Slab) -> None:
    film = abbe.render(slab(), width=32)
    assert film.statistics["complete"] is True
    assert json.loads(json.dumps(film.statistics)) == film.statistics
    assert film.metadata["abbe:version"] == abbe.__version__


def test_write_is_what_the_command_line_writes(slab: Slab, tmp_path: Path, run: Callable[..., object]) -> None:
    stage = slab()
    abbe.render(str(stage), width=32).write(tmp_path / "api.exr")
    run("render", stage, "cli.exr", "--width", "32")
    assert (tmp_path / "api.exr").read_bytes() == (tmp_path / "cli.exr").read_bytes()
    with pytest.raises(FileNotFoundError, match="nowhere"):
        abbe.render(stage, width=8).write(tmp_path / "nowhere" / "x.exr")


# Scenes


def test_a_stage_in_memory_and_its_file_give_the_same_bits(slab: Slab) -> None:
    from pxr import Usd

    path = slab()
    stage = Usd.Stage.Open(str(path))
    ours, theirs = (abbe.render(source, width=40, aovs=["dispersion"]) for source in (stage, path))
    np.testing.assert_array_equal(ours["dispersion"], theirs["dispersion"])


def test_a_scene_tells_what_it_is(slab: Slab, tmp_path: Path) -> None:
    scene = abbe.Scene.from_stage(slab())
    assert repr(scene) == "<abbe.Scene of slab.usda: 1 camera, 2 shapes, 1 material, frame 7>"
    scene.save(tmp_path / "scene.safetensors")
    assert repr(abbe.Scene.load(tmp_path / "scene.safetensors")) == repr(scene)


def test_a_saved_scene_gives_the_same_bits(slab: Slab, tmp_path: Path) -> None:
    scene = abbe.Scene.from_stage(slab())
    scene.save(tmp_path / "scene.safetensors")
    for mapped in (False, True):
        loaded = abbe.Scene.load(tmp_path / "scene.safetensors", mapped=mapped)
        assert loaded.document == scene.document
        films = [s.render(width=40, aovs=["dispersion2"]) for s in (scene, loaded)]
        np.testing.assert_array_equal(films[0]["dispersion2"], films[1]["dispersion2"])
    with pytest.raises(FileNotFoundError, match=r"nothing\.safetensors"):
        abbe.Scene.load(tmp_path / "nothing.safetensors")


def test_a_scene_renders_often_and_in_several_threads(slab: Slab) -> None:
    scene = abbe.Scene.from_stage(slab())
    films: list[abbe.Film] = []
    threads = [threading.Thread(target=lambda: films.append(scene.render(width=64, threads=1))) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(films) == 3
    for film in films[1:]:
        np.testing.assert_array_equal(film["dispersion"], films[0]["dispersion"])


def test_plans_and_traces(slab: Slab) -> None:
    scene = abbe.Scene.from_stage(slab(a="a.exr", b="b.exr"))
    assert scene.cameras[0] == "/World/Main"
    plans = scene.plans(width=16)
    assert [(plan.product, plan.output) for plan in plans] == [("/Render/a", "a.exr"), ("/Render/b", "b.exr")]
    assert plans[0].fields["resolution"][0] == 16
    assert "layers" in str(plans[0])
    told = scene.trace((8, 4), width=16, product="/Render/a")
    assert told["pixel"] == [8, 4]
    with pytest.raises(abbe.UsageError, match=r"product: the stage has 2: choose one of /Render/a, /Render/b"):
        scene.render()
    assert scene.render(product="/Render/b").resolution == (40, 20)


def test_options_take_numpy_numbers_and_refuse_nonsense(slab: Slab) -> None:
    scene = abbe.Scene.from_stage(slab())
    film = scene.render(width=np.int64(20), band=(np.float32(450), 600), aovs=np.array(["ior"]))  # type: ignore[arg-type]
    assert film.resolution[0] == 20
    nonsense: list[tuple[dict[str, object], str]] = [
        ({"aovs": "ior"}, "aovs: is the text 'ior'"),
        ({"wavelength": float("nan")}, "wavelength"),
        ({"width": "wide"}, "request"),
        ({"aovs": ["nonsense"]}, "--aov nonsense"),
        ({"no_such_option": 1}, "no_such_option"),
    ]
    for options, text in nonsense:
        with pytest.raises(abbe.UsageError, match=text):
            scene.render(**options)  # type: ignore[arg-type]


# Memory that crosses to Rust


def described(slab: Slab) -> tuple[str, dict[str, npt.NDArray[np.generic]]]:
    from abbe.usd import describe

    description = describe(slab())
    return description.to_json(), dict(description.arrays)


def test_read_only_arrays_are_shared_and_writable_ones_copied(slab: Slab) -> None:
    document, arrays = described(slab)
    name = next(name for name, array in arrays.items() if array.dtype == np.float32)
    original = np.array(arrays[name])

    frozen = original.copy()
    frozen.flags.writeable = False
    before = sys.getrefcount(frozen)
    scene = _core.Scene(document, {**arrays, name: frozen})
    assert sys.getrefcount(frozen) == before + 1, "the scene holds the array itself"
    del scene
    gc.collect()
    assert sys.getrefcount(frozen) == before, "and lets go of it"

    writable = original.copy()
    view = writable[:]
    view.flags.writeable = False
    for array in (writable, view):
        before = sys.getrefcount(array)
        scene = _core.Scene(document, {**arrays, name: array})
        assert sys.getrefcount(array) == before, "what could change is copied"
        request = json.dumps({"width": 24, "aovs": ["position"]})
        film = scene.render(request)
        writable[:] = 1e6
        np.testing.assert_array_equal(scene.render(request)["position"], film["position"])
        writable[:] = original


def test_shared_arrays_outlive_their_last_name(slab: Slab) -> None:
    document, arrays = described(slab)
    scene = _core.Scene(document, arrays)
    request = json.dumps({"width": 24, "aovs": ["position"]})
    wanted = np.array(scene.render(request)["position"])
    del arrays
    gc.collect()
    np.ones(1 << 20, dtype=np.float32)
    np.testing.assert_array_equal(scene.render(request)["position"], wanted)


def test_usd_arrays_cross_without_a_copy(slab: Slab) -> None:
    document, arrays = described(slab)
    points = [array for array in arrays.values() if array.dtype == np.float32]
    assert all(not array.flags.writeable for array in points)
    before = [sys.getrefcount(array) for array in points]
    scene = _core.Scene(document, arrays)
    assert [sys.getrefcount(array) for array in points] == [count + 1 for count in before]
    del scene


def test_strided_and_misaligned_arrays_are_put_in_order(slab: Slab) -> None:
    document, arrays = described(slab)
    request = json.dumps({"width": 24, "aovs": ["position", "dispersion"]})
    wanted = _core.Scene(document, arrays).render(request)
    strided = {name: np.repeat(array, 2, axis=0)[::2] for name, array in arrays.items()}
    buffers = {name: np.zeros(array.nbytes + 1, dtype=np.uint8) for name, array in arrays.items()}
    misaligned = {
        name: np.ndarray(array.shape, array.dtype, buffer=buffers[name], offset=1) for name, array in arrays.items()
    }
    for name, array in arrays.items():
        misaligned[name][...] = array
    for variant in (strided, misaligned):
        film = _core.Scene(document, variant).render(request)
        for aov in ("position", "dispersion"):
            np.testing.assert_array_equal(film[aov], wanted[aov])


def test_wrong_arrays_are_named(slab: Slab) -> None:
    document, arrays = described(slab)
    name = next(iter(arrays))
    for wrong in (arrays[name].astype(np.float16), arrays[name].astype(arrays[name].dtype.newbyteorder())):
        with pytest.raises(TypeError, match=name):
            _core.Scene(document, {**arrays, name: wrong})
    with pytest.raises(abbe.StageError):
        _core.Scene(document, {})
    with pytest.raises(abbe.StageError, match="scene description"):
        _core.Scene("{}", {})


# Long work


def test_progress_is_told_from_the_calling_thread(slab: Slab) -> None:
    told: list[abbe.Progress] = []
    threads: set[int] = set()

    def note(progress: abbe.Progress) -> None:
        told.append(progress)
        threads.add(threading.get_ident())

    film = abbe.render(slab(), width=64, progress=note)
    assert film.statistics["complete"]
    assert threads == {threading.get_ident()}
    assert told[-1].done == told[-1].total == 64 * 32
    assert told[-1].fraction == 1.0 and told[-1].remaining == 0.0
    assert str(told[-1]) == "100 %, 0 s left"
    assert abbe.Progress(0, 10, 1.0).remaining is None


BIG = {"width": 4000, "samples": 64, "aovs": ["dispersion2"]}


def test_an_exception_of_the_callback_stops_the_render_and_keeps_what_is_finished(slab: Slab) -> None:
    class Enough(Exception):
        film: abbe.Film

    def stop(progress: abbe.Progress) -> None:
        if progress.done > 0:
            raise Enough

    begin = time.monotonic()
    with pytest.raises(Enough) as caught:
        abbe.render(slab(), progress=stop, **BIG)  # type: ignore[arg-type]
    assert time.monotonic() - begin < 20.0
    film = caught.value.film
    assert film.statistics["complete"] is False
    assert 0 < film.statistics["pixels"] < 4000 * 2000


def test_the_interpreter_is_released_while_rendering(slab: Slab) -> None:
    scene = abbe.Scene.from_stage(slab())
    ticks: list[float] = []
    done = threading.Event()

    def tick() -> None:
        while not done.wait(0.01):
            ticks.append(time.monotonic())

    def stop_after_a_while(progress: abbe.Progress) -> None:
        if progress.seconds > 1.0:
            raise TimeoutError

    thread = threading.Thread(target=tick)
    thread.start()
    begin = time.monotonic()
    with pytest.raises(TimeoutError):
        scene.render(progress=stop_after_a_while, **BIG)  # type: ignore[arg-type]
    during = [at for at in ticks if begin < at < begin + 1.0]
    done.set()
    thread.join()
    # A held interpreter would let the other thread run about ten times, once for each call of the callback.
    assert len(during) > 20


def test_a_signal_handler_is_heard_while_rendering(slab: Slab) -> None:
    program = f"""
import _thread, threading, time, abbe
scene = abbe.Scene.from_stage({str(slab())!r})
threading.Timer(1.0, _thread.interrupt_main).start()
begin = time.monotonic()
try:
    scene.render(width=4000, samples=64, aovs=["dispersion2"])
except KeyboardInterrupt as interrupt:
    print(time.monotonic() - begin < 20.0, interrupt.film.statistics["complete"])
"""
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert result.stdout.split() == ["True", "False"], result.stderr


# Errors and warnings


def test_errors_have_one_base_and_the_usual_exceptions(slab: Slab, tmp_path: Path) -> None:
    assert issubclass(abbe.StageError, abbe.AbbeError) and issubclass(abbe.UsageError, abbe.AbbeError)
    with pytest.raises(FileNotFoundError, match=r"none\.usda"):
        abbe.render(tmp_path / "none.usda")
    with pytest.raises(abbe.StageError, match="/World/Wall"):
        abbe.render(slab(edit=("[0, 1, 2, 3]", "[0, 1, 2, 4]")), strict=True)
    with pytest.raises(abbe.UsageError, match="--width"):
        abbe.render(slab(), width=0)


def test_warnings_go_to_the_logger_once(slab: Slab, caplog: pytest.LogCaptureFixture) -> None:
    stage = slab(edit=("float inputs:roughness = 0", "float inputs:clearcoat = 0.5"))
    scene = abbe.Scene.from_stage(stage)
    film = scene.render(width=16, aovs=["ior"])
    texts = [record.getMessage() for record in caplog.records if record.name == "abbe"]
    assert len(texts) == len(set(texts))
    assert len(film.statistics["warnings"]) == len(texts)


def test_nothing_optional_is_needed_to_import(tmp_path: Path) -> None:
    program = """
import sys
for name in ("pxr", "OpenImageIO", "PIL"):
    sys.modules[name] = None
import abbe
print(abbe.Dispersion.abbe(nd=1.5, vd=60).abbe_number)
try:
    abbe.render("x.usda")
except abbe.UsdMissingError as error:
    print(error)
"""
    result = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=True)
    number, error = result.stdout.splitlines()
    assert float(number) == pytest.approx(60.0, rel=1e-12)
    assert "pip install 'abbe[usd]'" in error


def test_importing_registers_the_schemas() -> None:
    program = """
import abbe
from pxr import Usd
stage = Usd.Stage.CreateInMemory()
prim = stage.DefinePrim("/M", "Material")
print(prim.ApplyAPI("AbbeDispersionAPI"))
"""
    result = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=True)
    assert result.stdout == "True\n"


def test_schemas_that_come_too_late_are_warned_of() -> None:
    program = """
from pxr import Usd
stage = Usd.Stage.CreateInMemory()
stage.DefinePrim("/M", "Material").GetPrimDefinition()
import abbe
"""
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "import abbe before opening a stage" in result.stderr


# The optics alone


def bk7() -> abbe.Dispersion:
    return abbe.Dispersion.sellmeier(
        b=[1.03961212, 0.231792344, 1.01046945], c_um2=[0.00600069867, 0.0200179144, 103.560653]
    )


def test_dispersion_laws_are_vectorised() -> None:
    glass = bk7()
    # SCHOTT's data sheet prints n_d = 1.51680 and V_d = 64.17.
    assert glass.ior(587.5618) == pytest.approx(1.51680, abs=5e-6)
    assert glass.abbe_number == pytest.approx(64.17, abs=5e-3)
    assert isinstance(glass.ior(500), float)
    nm = np.linspace(400, 700, 12).reshape(3, 4)
    assert glass.ior(nm).shape == glass.dior_dlambda(nm).shape == glass.d2ior_dlambda2(nm).shape == (3, 4)
    assert glass.ior([500, 600]).tolist() == [glass.ior(500), glass.ior(600)]
    h = 0.01
    slope = (glass.ior(nm + h) - glass.ior(nm - h)) / (2 * h)
    # Central differences: h²/6 n''' ~ 1e-13 and rounding 1e-16/h ~ 1e-14, against 3e-5 per nm.
    np.testing.assert_allclose(glass.dior_dlambda(nm), slope, rtol=1e-8)
    bend = (glass.dior_dlambda(nm + h) - glass.dior_dlambda(nm - h)) / (2 * h)
    np.testing.assert_allclose(glass.d2ior_dlambda2(nm), bend, rtol=1e-7)


def test_dispersion_constructors() -> None:
    constant = abbe.Dispersion.constant(1.5)
    assert constant.is_constant and constant.abbe_number is None and constant.dior_dlambda(500) == 0.0
    cauchy = abbe.Dispersion.cauchy(a=1.5045833, b_um2=0.0042175527)
    assert cauchy.ior(500) == pytest.approx(1.5045833 + 0.0042175527 / 0.25, rel=1e-15)
    three = abbe.Dispersion.cauchy(1.5, 0.004, c_um4=1e-5)
    assert three.ior(500) == pytest.approx(1.5 + 0.004 / 0.25 + 1e-5 / 0.0625, rel=1e-15)
    made = abbe.Dispersion.abbe(nd=1.7, vd=30.0)
    assert made.ior(587.5618) == pytest.approx(1.7, rel=1e-15) and made.abbe_number == pytest.approx(30.0, rel=1e-12)
    assert made.scaled(2.0).abbe_number == pytest.approx(15.0, rel=1e-12)
    assert made.scaled(0.0).is_constant
    assert "1.7" in repr(made)
    for wrong in (
        lambda: abbe.Dispersion.constant(0.0),
        lambda: abbe.Dispersion.abbe(nd=1.5, vd=0.0),
        lambda: abbe.Dispersion.sellmeier(b=[1.0], c_um2=[0.25]),
        lambda: abbe.Dispersion.sellmeier(b=[1.0], c_um2=[]),
        lambda: made.ior(0.0),
        lambda: made.ior(float("nan")),
    ):
        with pytest.raises(abbe.UsageError):
            wrong()


def unit(vectors: npt.ArrayLike) -> npt.NDArray[np.float64]:
    array = np.asarray(vectors, dtype=np.float64)
    return array / np.linalg.norm(array, axis=-1, keepdims=True)


def test_refraction_obeys_snell_and_broadcasts() -> None:
    random = np.random.default_rng(1)
    direction = unit(random.normal(size=(5, 1, 3)))
    normal = unit(random.normal(size=(7, 3)))
    out = abbe.refract(direction, normal, 1.0, [[1.5]] * 5)
    assert out.direction.shape == out.ddirection.shape == (5, 7, 3)
    assert out.total_reflection.shape == (5, 7) and not out.total_reflection.any()
    np.testing.assert_allclose(np.linalg.norm(out.direction, axis=-1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(1.5 * np.cross(normal, out.direction), np.cross(normal, direction), atol=1e-14)
    assert np.all(out.ddirection == 0.0)
    single = abbe.refract((0, 0, -1), (0, 0, 1), 1.0, 1.5)
    assert single.direction.shape == (3,) and single.total_reflection.shape == ()


def test_total_reflection_is_flagged_and_reflects() -> None:
    direction = unit((1.0, 0.0, -0.5))
    out = abbe.refract(direction, (0, 0, 1), 1.5, 1.0)
    assert out.total_reflection
    np.testing.assert_allclose(out.direction, abbe.reflect(direction, (0, 0, 1)).direction, rtol=1e-15)


def test_derivatives_of_the_calculus_match_finite_differences() -> None:
    glass, other = bk7(), abbe.Dispersion.abbe(nd=1.7, vd=30.0)
    direction, normal, n_g = unit((0.3, -0.2, -1.0)), unit((0.1, 0.2, 1.0)), unit((0.0, 0.3, 1.0))

    def trace(nm: float) -> tuple[npt.NDArray[np.float64], ...]:
        refracted = abbe.refract(
            direction,
            normal,
            other.ior(nm),
            glass.ior(nm),
            dior_i=other.dior_dlambda(nm),
            dior_t=glass.dior_dlambda(nm),
        )
        reflected = abbe.reflect(refracted.direction, n_g, ddirection=refracted.ddirection)
        # The surface is the plane through (0, 0, -2) with normal n_g.
        distance = (np.array([0, 0, -2.0]) @ n_g) / (refracted.direction @ n_g)
        moved = abbe.transfer((0, 0, 0), refracted.direction, distance, n_g, ddirection=refracted.ddirection)
        return (*refracted[:2], *reflected, *moved)

    h = 0.05
    here, above, below = trace(550.0), trace(550.0 + h), trace(550.0 - h)
    for value, derivative in ((0, 1), (2, 3), (4, 5)):
        numeric = (above[value] - below[value]) / (2 * h)
        assert np.linalg.norm(numeric) > 1e-6
        # Relative to the vector: h² n'''/n' ~ 1e-8 from the formula, 1e-16/h/1e-5 ~ 1e-10 from rounding.
        np.testing.assert_allclose(here[derivative], numeric, atol=1e-7 * np.linalg.norm(numeric))


def test_a_transfer_along_the_surface_is_nan() -> None:
    moved = abbe.transfer((0, 0, 0), [(1, 0, 0), (0, 0, -1)], 1.0, (0, 0, 1))
    assert np.isnan(moved.point[0]).all() and np.isnan(moved.dpoint[0]).all()
    np.testing.assert_array_equal(moved.point[1], (0, 0, -1))


def test_nothing_at_all_is_no_error() -> None:
    empty = np.zeros((0, 3))
    assert abbe.refract(empty, (0, 0, 1), 1.0, 1.5).direction.shape == (0, 3)
    assert abbe.reflect(empty, empty).ddirection.shape == (0, 3)
    assert bk7().ior([]).shape == (0,)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (((0, 0, -2), (0, 0, 1), 1.0, 1.5), "direction: .*normalise"),
        (((0, 0, -1), (0, 0, 0), 1.0, 1.5), "normal: .*normalise"),
        (((0, 0), (0, 0, 1), 1.0, 1.5), "direction: has shape"),
        (((0, 0, float("nan")), (0, 0, 1), 1.0, 1.5), "direction: is not finite"),
        (((0, 0, -1), (0, 0, 1), 0.0, 1.5), "ior_i: must be finite and positive"),
        (([(0, 0, -1)] * 2, [(0, 0, 1)] * 3, 1.0, 1.5), "do not broadcast"),
    ],
)
def test_bad_arguments_of_the_calculus_are_named(arguments: tuple[npt.ArrayLike, ...], text: str) -> None:
    with pytest.raises(abbe.UsageError, match=text):
        abbe.refract(*arguments)


def test_many_warnings_of_a_kind_are_told_in_few_lines() -> None:
    def record(kind: str, i: int, count: int = 1) -> dict[str, Any]:
        return {"kind": kind, "message": f"message {i}", "places": [f"</P{i}>"], "count": count}

    many = [record("missing-material", i, count=i + 1) for i in range(40)]
    lines = warning_lines([record("other", 0), *many[:20], record("other", 1), *many[20:]])
    told = ["</P0>: message 0", "</P1>: message 1"]
    assert lines[:5] == [*told, "</P0>: message 0", "</P1> and 1 more: message 1", "</P2> and 2 more: message 2"]
    assert len(lines) == 6
    assert lines[5].startswith("</P3> and 813 more: other warnings of the kind missing-material, 37 in all: ")
    # Four are as short as three and a count.
    assert warning_lines(many[:4])[3] == "</P3> and 3 more: message 3"
    assert warning_lines([]) == []
