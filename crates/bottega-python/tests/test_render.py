"""Pictures: arrays, files, callbacks, the same bits as the command line."""

from __future__ import annotations

import gc
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bottega

SMALL: Any = {"spp": 4, "size": (40, 30), "exact": True}


def test_layers_are_looks_into_one_memory(box: Path) -> None:
    picture = bottega.render(box, layers=["all"], **SMALL)
    assert picture.shape == (30, 40) and picture.crop == (0, 0, 40, 30) and picture.is_whole
    first = ["position", "geometric-normal", "uv", "direct", "indirect", "motion", "crypto-object", "crypto-material", "crypto-asset"]
    assert picture.layers == ["color", "alpha", "error", "samples", "albedo", "normal", "depth", "cost", *first]
    assert (picture["motion"] == np.zeros((30, 40, 4))).all()
    assert picture["position"].shape == (30, 40, 3) and picture["uv"].shape == (30, 40, 2)
    assert picture["crypto-object"].shape == (30, 40, 16)
    assert np.allclose(picture["direct"] + picture["indirect"], picture.color, rtol=1e-4, atol=1e-5)
    shapes = {"color": (30, 40, 3), "alpha": (30, 40), "samples": (30, 40), "normal": (30, 40, 3), "depth": (30, 40)}
    for name, shape in shapes.items():
        layer = picture[name]
        assert layer.shape == shape and layer.dtype == np.float32, name
        assert np.shares_memory(layer, picture.values), f"{name} is a copy"
        assert not layer.flags.writeable
    assert (picture["samples"] == 4).all() and picture.color.mean() > 0.01
    lengths = np.linalg.norm(picture["normal"], axis=-1)
    assert lengths.max() <= 1.001 and "normal" in picture and "speed" not in picture
    with pytest.raises(KeyError, match="albedo"):
        picture["speed"]
    with pytest.raises(ValueError):
        picture.color[0, 0, 0] = 1



def test_layers_of_a_file_have_all_channels(box: Path, tmp_path: Path) -> None:
    picture = bottega.render(box, layers=["uv", "position", "crypto-object", "error"], **SMALL)
    picture.save(tmp_path / "a.exr")
    file = bottega.read(tmp_path / "a.exr")
    assert np.array_equal(file["uv"], picture["uv"]) and np.array_equal(file["P"], picture["position"])
    # The file has six of the eight ranks, two in each layer
    ranks = np.concatenate([file[f"CryptoObject0{pair}"] for pair in range(3)], axis=-1)
    assert ranks.shape == (30, 40, 12) and np.array_equal(ranks, picture["crypto-object"][..., :12])
    assert (ranks[..., 1] > 0).any() and ranks[..., 1::2].sum(axis=-1).max() <= 1.0001


def test_arrays_outlive_their_picture(box: Path) -> None:
    color = bottega.render(box, **SMALL).color
    before = color.copy()
    gc.collect()
    for _ in range(3):
        bottega.render(box, seed=7, **SMALL)
    assert (color == before).all()


def test_a_picture_is_an_array(box: Path) -> None:
    picture = bottega.render(box, **SMALL)
    assert np.asarray(picture).base is not None and (np.asarray(picture) == picture.color).all()
    assert np.asarray(picture, np.float64).dtype == np.float64
    copy = np.array(picture)
    copy[:] = 0
    assert picture.color.max() > 0


def test_files_hold_the_picture(box: Path, tmp_path: Path) -> None:
    picture = bottega.render(box, **SMALL)
    picture.save(tmp_path / "a.exr")
    picture.save(str(tmp_path / "a.png"))
    file = bottega.read(tmp_path / "a.exr")
    assert (file.color == picture.color).all() and file.full_size == (40, 30) and file.offset == (0, 0)
    assert bottega.Request.from_json(file.metadata["request"]) == picture.request
    png = picture._repr_png_()
    assert png == (tmp_path / "a.png").read_bytes() and png.startswith(b"\x89PNG")
    assert picture.metadata["samples_per_pixel"] == "4"
    assert sum(zone["size"] for zone in picture.report["zones"]) == 40 * 30 and picture.report["is_whole"]
    for path in ("nowhere/a.exr", "a.gif"):
        with pytest.raises(bottega.PictureError):
            picture.save(tmp_path / path)
    with pytest.raises(bottega.PictureError):
        bottega.read(tmp_path / "none.exr")


def test_the_bits_are_those_of_the_command_line(box: Path, program: str, tmp_path: Path) -> None:
    out = tmp_path / "line.exr"
    words = ["--spp", "8", "--size", "64x48", "--aov", "all", "--exact", "--threads", "1", "--quiet"]
    subprocess.run([program, "render", str(box), "-o", str(out), *words], check=True, capture_output=True)
    picture = bottega.render(box, spp=8, size=(64, 48), layers=["all"], exact=True)
    assert (picture.color.view(np.uint32) == bottega.read(out).color.view(np.uint32)).all()
    request = bottega.Request.from_json(bottega.read(out).metadata["request"])
    again = bottega.render(request.changed(output=bottega.OutputOptions()))
    assert (again.values.view(np.uint32) == picture.values.view(np.uint32)).all()


def test_callbacks_run_in_the_calling_thread(box: Path) -> None:
    import threading

    events: list[dict[str, Any]] = []
    progress: list[bottega.Progress] = []
    threads = set()

    def hear(event: dict[str, Any]) -> None:
        threads.add(threading.get_ident())
        events.append(event)

    bottega.render(box, spp=120, size=(160, 120), on_event=hear, on_progress=progress.append)
    assert threads == {threading.get_ident()}
    kinds = [event["event"] for event in events]
    assert "started" in kinds and "analyzed" in kinds and "zone" in kinds and kinds[-1] == "finished"
    assert progress[-1].fraction == 1 and progress[-1].done == progress[-1].total == 120 * 160 * 120
    fractions = [step.fraction for step in progress]
    assert len(fractions) > 1 and all(0 <= fraction <= 1 for fraction in fractions)


def test_what_a_callback_raises_comes_out(box: Path) -> None:
    def fail(event: dict[str, Any]) -> None:
        if event["event"] == "zone":
            raise LookupError("mine")

    begun = time.monotonic()
    with pytest.raises(LookupError, match="mine"):
        bottega.render(box, spp=1_000_000, size=(640, 480), on_event=fail)
    assert time.monotonic() - begun < 20


def test_warnings_are_warnings(box: Path, tmp_path: Path) -> None:
    text = (Path(__file__).parents[3] / "rules" / "path-tracing.fcl").read_text()
    odd = tmp_path / "odd.fcl"
    odd.write_text(text.replace("samples", "sample"))
    with pytest.warns(bottega.RenderWarning):
        bottega.render(box, optimization="n", work={"rules": [{"file": str(odd)}]}, **SMALL)


def test_layers_are_there_while_a_picture_is_painted(box: Path) -> None:
    session = bottega.Session(box, live=True, layers=["depth"], spp=64, size=(64, 48))
    assert session.layers() is None
    seen: list[dict[str, Any]] = []

    def look(_: bottega.Progress) -> None:
        layers = session.layers()
        if layers is not None:
            seen.append(layers)

    picture = session.render(on_progress=look)
    last = session.layers()
    assert last is not None and seen
    assert last["color"].shape == (48, 64, 3) and last["depth"].shape == (48, 64)
    # All samples of a pixel, but without the bands between zones.
    assert np.isclose(last["color"].mean(), picture.color.mean(), rtol=0.02)
    assert np.array_equal(last["depth"] > 0, picture["depth"] > 0)
