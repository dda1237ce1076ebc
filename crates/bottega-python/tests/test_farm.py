"""A farm of real processes."""

from __future__ import annotations

import contextlib
import os
import re
import socket
import subprocess
import time
from pathlib import Path
from typing import Iterator

import numpy as np
import pytest

import bottega


@pytest.fixture
def farm(program: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[bottega.Farm]:
    """A farm with one machine."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.delenv("BOTTEGA_FARM", raising=False)
    log = tmp_path / "up.log"
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = os.environ.get("BOTTEGA_NATS_SERVERS", "").split(":")[0]
    with contextlib.ExitStack() as running:
        out = running.enter_context(log.open("a"))

        def start(*words: str) -> subprocess.Popen[bytes]:
            process = subprocess.Popen([program, *words], stdout=out, stderr=out)
            running.callback(process.wait, 20)
            running.callback(process.terminate)
            return process

        up = start("up", "--listen", f"127.0.0.1:{port}", "--hidden", *(["--server", server] if server else []))
        address = None
        end = time.monotonic() + 20
        while address is None and time.monotonic() < end and up.poll() is None:
            found = re.search(r"bottega://\S+", log.read_text())
            address = found and found.group()
            time.sleep(0.05)
        if "there is no NATS server" in log.read_text():
            pytest.skip("there is no NATS server")
        assert address, log.read_text()
        start("join", address, "--threads", "1")
        yield bottega.Farm(address)


def test_a_farm_paints_the_same_bits(farm: bottega.Farm, box: Path, tmp_path: Path) -> None:
    asked = {"spp": 8, "size": (64, 48), "exact": True}
    plain = bottega.render(box, **asked)  # type: ignore[arg-type]
    job = farm.submit(box, output=tmp_path / "a.exr", **asked)  # type: ignore[arg-type]
    seen = [view["state"] for view in job.watch()]
    assert seen[-1] == "done", job.log()
    assert job.wait(1)["done"] == 1 and [other.number for other in farm.jobs()] == [job.number]
    machines = farm.machines()
    assert [machine["threads"] for machine in machines] == [1] and machines[0]["state"] == "active"
    assert job.fetch(tmp_path / "b.exr") == tmp_path / "b.exr"
    assert (bottega.read(tmp_path / "b.exr").color == plain.color).all()
    assert any("asked for" in line["text"] for line in job.log())
    path = farm.render(box, output=tmp_path / "c.exr", **asked)  # type: ignore[arg-type]
    assert (bottega.read(path).color == plain.color).all()

    paused = farm.submit(box, spp=100_000, size=(320, 240), output=tmp_path / "d.exr")
    paused.pause()
    assert paused.view()["state"] == "paused"
    with pytest.raises(TimeoutError):
        paused.wait(0.1)
    paused.cancel()
    assert paused.wait(5)["state"] == "cancelled"
    with pytest.raises(bottega.FarmError):
        paused.resume()
    paused.remove()
    with pytest.raises(bottega.FarmError, match="no job"):
        paused.view()
    with pytest.raises(bottega.FarmError, match="file"):
        farm.render(box, spp=1)
    with pytest.raises(bottega.SceneError, match="no camera"):
        farm.render(bottega.Scene(), output="a.exr")


def test_a_scene_in_memory_goes_to_a_farm(farm: bottega.Farm, box: Path, tmp_path: Path) -> None:
    asked = {"spp": 8, "size": (64, 48), "exact": True}
    scene = bottega.Scene.read(box)
    scene.images["checks"] = bottega.Image(np.indices((8, 8)).sum(0).astype(np.uint8) % 2 * 200 + 20)
    scene.materials["painted"] = bottega.Material(bottega.Diffuse(bottega.Texture("checks")))
    scene.objects[scene.objects.keys()[0]].materials = ["painted"]
    scene.lights["sun"] = bottega.SunLight((0.0, -1.0, -0.2), (0.5, 0.4, 0.3), angle=0.05)
    plain = bottega.render(scene, **asked)  # type: ignore[arg-type]
    # The same bits from a farm, from a file, and from the scene that was read of the file
    path = farm.render(scene, output=tmp_path / "a.exr", **asked)  # type: ignore[arg-type]
    assert (bottega.read(path).color == plain.color).all()
    scene.save(tmp_path / "scene.bottega")
    for kept in (tmp_path / "scene.bottega", bottega.Scene.read(tmp_path / "scene.bottega")):
        assert (bottega.render(kept, **asked).color == plain.color).all()  # type: ignore[arg-type]
    # Submitted, changed meanwhile, and fetched
    job = farm.submit(scene, output=tmp_path / "b.exr", **asked)  # type: ignore[arg-type]
    scene.objects.hide(scene.objects.keys()[0])
    assert job.wait(120)["state"] == "done", job.log()
    assert (bottega.read(job.fetch(tmp_path / "b.exr")).color == plain.color).all()
    # Seen while it is rendered
    session = farm.session(scene, live=True, output=tmp_path / "c.exr", **asked)  # type: ignore[arg-type]
    assert session.layers() is None
    path = session.render()
    layers = session.layers()
    assert layers is not None and layers["color"].shape == (48, 64, 3)
    assert (layers["color"] == bottega.read(path).color).all() and (layers["color"] != plain.color).any()
    with pytest.raises(bottega.Error, match="once"):
        session.render()


def test_farms_that_are_not_there_are_told() -> None:
    with pytest.raises(bottega.FarmError, match="address"):
        bottega.Farm("bottega:/nowhere")
    word = "t" + "0" * 32
    with pytest.raises(bottega.FarmError):
        bottega.Farm(f"bottega://{word}@127.0.0.1:1")
