"""Growing renders: films in between, a picture that follows, a viewer, limits."""

import json
import socket
import struct
import threading
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest

import abbe
from abbe.check import check

Slab = Callable[..., Path]
Run = Callable[..., CompletedProcess[str]]

OPTIONS = {"width": 24, "samples": 12, "aovs": ["color", "sample_count", "depth", "primId"]}


def test_films_grow_to_the_render(slab: Slab) -> None:
    films = list(abbe.progressive(slab(), **OPTIONS))
    assert [film.samples for film in films] == [1, 2, 4, 8, 12]
    whole = abbe.render(slab(), **OPTIONS)
    for name in whole:
        assert np.array_equal(films[-1][name], whole[name]), name
    assert [int(film["sample_count"].max()) for film in films] == [1, 2, 4, 8, 12]
    # Each is the film of its samples, and has a header that says so.
    part = abbe.render(slab(), **OPTIONS, sample_range=(0, 4))
    assert np.array_equal(films[2]["color"], part["color"])
    assert films[2].metadata["abbe:samples"] == 4


def test_a_loop_that_ends_early_ends_the_render(slab: Slab, tmp_path: Path) -> None:
    scene = abbe.Scene.from_stage(slab())
    for film in scene.progressive(width=24, samples=1 << 20, aovs=["color"]):
        if film.samples == 4:
            film.write(tmp_path / "four.exr")
            break
    assert (tmp_path / "four.exr").is_file()
    assert not [thread for thread in threading.enumerate() if thread.name == "abbe.progressive"]


def test_errors_come_at_once(slab: Slab) -> None:
    with pytest.raises(abbe.UsageError, match="samples"):
        abbe.progressive(slab(), width=24, samples=0)


def test_an_exception_of_the_callback_stops(slab: Slab) -> None:
    scene = abbe.Scene.from_stage(slab())

    def passed(film: abbe.Film) -> None:
        if film.samples == 2:
            raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        scene.render_plan(0, passed=passed, **OPTIONS)


def test_error_target_and_time_limit(slab: Slab) -> None:
    film = abbe.render(slab(), width=24, samples=256, error_target=0.1, aovs=["color", "sample_count", "variance"])
    counts = film["sample_count"]
    assert counts.min() >= 16 and counts.max() <= 256
    assert film.statistics["samples"] == counts.sum(dtype=np.uint64)
    assert film.metadata["abbe:errorTarget"] == 0.1
    limited = abbe.render(slab(), width=24, samples=1 << 22, time_limit=0.2, aovs=["color"])
    assert limited.statistics["complete"] and limited.statistics["reached_time_limit"]
    assert limited.metadata["abbe:reproducible"] == 0
    with pytest.raises(abbe.UsageError, match="sample-range"):
        abbe.render(slab(), width=24, samples=64, error_target=0.1, sample_range=(0, 32), aovs=["color"])


def test_spectra_are_arrays_with_named_bins(slab: Slab, tmp_path: Path) -> None:
    film = abbe.render(slab(), width=24, samples=4, aovs=["color", "spectral:400:700:50"])
    assert film["spectral"].shape[2] == 6
    assert film.channels("spectral") == ["w425", "w475", "w525", "w575", "w625", "w675"]
    film.write(tmp_path / "both.exr")
    alone = abbe.render(slab(), width=24, samples=4, aovs=["spectral:400:700:50"])
    assert alone.metadata["spectralLayoutVersion"] == "1.0"
    assert alone.channels("spectral")[0] == "425,000000nm"
    alone.write(tmp_path / "alone.exr")
    for name in ("both.exr", "alone.exr"):
        report = check(tmp_path / name)
        assert report.passed, report.failures


def test_the_preview_follows_the_render(run: Run, slab: Slab, tmp_path: Path) -> None:
    result = run(
        *("render", slab(), "out.exr", "--width", "24", "--samples", "8", "--aov", "color", "--aov", "variance"),
        *("--preview", "out.png", "--stats", "stats.json"),
    )
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "out.png").read_bytes().startswith(b"\x89PNG")
    # The picture asks the render to grow, which changes nothing.
    assert json.loads((tmp_path / "stats.json").read_text())["renders"][0]["passes"] == 4
    assert (
        run(
            "render", slab(), "one.exr", "--width", "24", "--samples", "8", "--aov", "color", "--aov", "variance"
        ).returncode
        == 0
    )
    assert (tmp_path / "out.exr").read_bytes() == (tmp_path / "one.exr").read_bytes()


def _text(data: bytes, at: int) -> tuple[str, int]:
    end = data.index(b"\0", at)
    return data[at:end].decode(), end + 1


def test_tev_gets_the_pixels(slab: Slab) -> None:
    from abbe import tev

    server = socket.create_server(("127.0.0.1", 0))
    received = bytearray()

    def listen() -> None:
        connection, _ = server.accept()
        with connection:
            while part := connection.recv(1 << 16):
                received.extend(part)

    listener = threading.Thread(target=listen)
    listener.start()
    film = abbe.render(slab(), width=24, samples=4, aovs=["color", "depth"])
    with tev.Viewer(f"127.0.0.1:{server.getsockname()[1]}", "scene") as viewer:
        viewer.show(film)
        viewer.show(film)
    listener.join()
    server.close()
    packets = []
    while received:
        (length,) = struct.unpack_from("<I", received)
        packets.append(bytes(received[4:length]))
        del received[:length]
    # One image is made, and updated by layers.
    assert [packet[0] for packet in packets] == [4, 6, 6, 6, 6]
    name, at = _text(packets[0], 2)
    assert name == "scene"
    assert struct.unpack_from("<iii", packets[0], at) == (24, 12, 5)
    at += 12
    channels = []
    while at < len(packets[0]):
        channel, at = _text(packets[0], at)
        channels.append(channel)
    assert channels == ["R", "G", "B", "A", "depth.Z"]
    _, at = _text(packets[1], 2)
    assert struct.unpack_from("<i", packets[1], at) == (4,)
    at += 4
    for _ in range(4):
        _, at = _text(packets[1], at)
    assert struct.unpack_from("<iiii", packets[1], at) == (0, 0, 24, 12)
    at += 16 + 2 * 4 * 8
    assert np.array_equal(np.frombuffer(packets[1][at:], "<f4").reshape(12, 24, 4), film["color"])


def test_tev_that_is_not_there_is_said() -> None:
    from abbe import tev

    with pytest.raises(abbe.UsageError, match="HOST:PORT"):
        tev.Viewer("nowhere")
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(abbe.AbbeError, match="start it first"):
        tev.Viewer(f"127.0.0.1:{port}")
