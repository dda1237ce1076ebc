"""A farm of real processes."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import socket
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterator

import numpy as np
import pytest

import bottega


@dataclass
class Addresses:
    """Where a farm with one machine is: for machines, and its page for those who steer."""

    farm: str
    page: str


@pytest.fixture
def farm(addresses: Addresses) -> bottega.Farm:
    """A farm with one machine."""
    return bottega.Farm(addresses.farm)


@pytest.fixture
def addresses(program: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Addresses]:
    """The addresses of a farm with one machine."""
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
        found: list[re.Match[str] | None] = [None]
        end = time.monotonic() + 20
        while not all(found) and time.monotonic() < end and up.poll() is None:
            patterns = r"bottega://\S+", r"http://\S+\?token=\S+"
            found = [re.search(pattern, log.read_text()) for pattern in patterns]
            time.sleep(0.05)
        if "there is no NATS server" in log.read_text():
            pytest.skip("there is no NATS server")
        address, page = [match.group() if match else "" for match in found]
        assert address and page, log.read_text()
        start("join", address, "--threads", "1")
        yield Addresses(address, page)


def test_a_farm_paints_the_same_bits(farm: bottega.Farm, box: Path, tmp_path: Path) -> None:
    options = {"spp": 8, "size": (64, 48), "exact": True}
    plain = bottega.render(box, **options)  # type: ignore[arg-type]
    job = farm.submit(box, output=tmp_path / "a.exr", **options)  # type: ignore[arg-type]
    seen = [view["state"] for view in job.watch()]
    assert seen[-1] == "done", job.log()
    assert job.wait(1)["done"] == 1 and [other.number for other in farm.jobs()] == [job.number]
    machines = farm.machines()
    assert [machine["threads"] for machine in machines] == [1] and machines[0]["state"] == "active"
    assert job.fetch(tmp_path / "b.exr") == tmp_path / "b.exr"
    assert (bottega.read(tmp_path / "b.exr").color == plain.color).all()
    assert any("submitted by" in line["text"] for line in job.log())
    path = farm.render(box, output=tmp_path / "c.exr", **options)  # type: ignore[arg-type]
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


def test_a_job_is_steered_and_seen_while_it_is_painted(farm: bottega.Farm, box: Path, tmp_path: Path) -> None:
    options = {"samples": 2000, "size": (160, 120), "layers": ["depth"]}
    job = farm.submit(box, output=tmp_path / "a.exr", **options)  # type: ignore[arg-type]
    job.priority = 7
    assert job.priority == 7
    with pytest.raises(ValueError, match="1 to 1000"):
        job.priority = 0

    # Something is seen before all of it is done
    done: list[dict[str, Any]] = []
    for view in job.watch():
        assert view["state"] == "active"
        done = [zone for zone in job.zones() if zone["state"] == "done"]
        if done:
            break
    preview, layers = job.preview(), job.layers()
    assert layers is not None and layers["depth"].shape == (120, 160) and (layers["depth"] > 0).any()
    assert preview is not None and preview.shape == (120, 160, 3) and preview.any()
    assert {"id", "rect", "agent"} <= done[0].keys()
    with pytest.raises(bottega.FarmError, match="no zone"):
        job.requeue(999_999)
    job.requeue(done[0]["id"])

    # Its end is awaited by coroutines, while others run
    async def until_the_end() -> list[str]:
        states = []
        async for view in job.watch():
            states.append(view["state"])
            if len(states) == 1:
                job.cancel()
        return states

    assert asyncio.run(until_the_end())[-1] == "cancelled"
    assert any("painted again" in line["text"] for line in job.log())
    small = farm.submit(box, output=tmp_path / "b.exr", samples=2, size=(32, 24), layers=["depth"])
    assert small.wait(60)["state"] == "done"
    layers = small.layers()
    assert layers is not None and {"color", "alpha", "depth"} <= layers.keys()


def test_a_scene_in_memory_goes_to_a_farm(farm: bottega.Farm, box: Path, tmp_path: Path) -> None:
    options = {"spp": 8, "size": (64, 48), "exact": True}
    scene = bottega.Scene.read(box)
    scene.images["checks"] = bottega.Image(np.indices((8, 8)).sum(0).astype(np.uint8) % 2 * 200 + 20)
    scene.materials["painted"] = bottega.Material(bottega.Diffuse(bottega.Texture("checks")))
    scene.objects[scene.objects.keys()[0]].materials = ["painted"]
    scene.lights["sun"] = bottega.SunLight((0.0, -1.0, -0.2), (0.5, 0.4, 0.3), angle=0.05)
    plain = bottega.render(scene, **options)  # type: ignore[arg-type]
    # The same bits from a farm, from a file, and from the scene that was read of the file
    path = farm.render(scene, output=tmp_path / "a.exr", **options)  # type: ignore[arg-type]
    assert (bottega.read(path).color == plain.color).all()
    scene.save(tmp_path / "scene.bottega")
    for kept in (tmp_path / "scene.bottega", bottega.Scene.read(tmp_path / "scene.bottega")):
        assert (bottega.render(kept, **options).color == plain.color).all()  # type: ignore[arg-type]
    # Submitted, changed meanwhile, and fetched
    job = farm.submit(scene, output=tmp_path / "b.exr", **options)  # type: ignore[arg-type]
    scene.objects.hide(scene.objects.keys()[0])
    assert job.wait(120)["state"] == "done", job.log()
    assert (bottega.read(job.fetch(tmp_path / "b.exr")).color == plain.color).all()
    # Seen while it is rendered
    session = farm.session(scene, live=True, output=tmp_path / "c.exr", **options)  # type: ignore[arg-type]
    assert session.layers() is None
    path = session.render()
    layers = session.layers()
    assert layers is not None and layers["color"].shape == (48, 64, 3)
    assert (layers["color"] == bottega.read(path).color).all() and (layers["color"] != plain.color).any()
    with pytest.raises(bottega.Error, match="once"):
        session.render()


def test_a_farm_is_used_by_http(addresses: Addresses, box: Path, tmp_path: Path) -> None:
    options = {"spp": 4, "size": (64, 48), "exact": True}
    farm = bottega.Farm(addresses.page)
    while not farm.machines():
        time.sleep(0.1)
    scene = bottega.Scene.read(box)
    scene.lights["sun"] = bottega.SunLight((0.0, -1.0, -0.2), (0.5, 0.4, 0.3))
    job = farm.submit(scene, output=tmp_path / "a.exr", **options)  # type: ignore[arg-type]
    seen = list(job.watch())
    assert seen[-1]["state"] == "done", job.log()
    assert job.fetch() == tmp_path / "a.exr"
    plain = bottega.render(scene, **options)  # type: ignore[arg-type]
    assert (bottega.read(tmp_path / "a.exr").color == plain.color).all()
    preview, layers = job.preview(), job.layers()
    assert preview is not None and preview.shape == (48, 64, 3)
    assert layers is not None and (layers["color"] == plain.color).all()
    assert all(zone["state"] == "done" for zone in job.zones()) and job.zones()
    job.remove()
    assert farm.jobs() == []
    # A mesh beside the scene and a texture outside of its folder go along
    folder = tmp_path / "project" / "scenes"
    folder.mkdir(parents=True)
    (tmp_path / "project" / "triangle.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    text = '<scene version="3.0.0"><shape type="ply"><string name="filename" value="../triangle.ply"/></shape></scene>'
    (folder / "scene.xml").write_text(text)
    request = bottega.Request.of(folder / "scene.xml", output=tmp_path / "b.exr", **options)  # type: ignore[arg-type]
    request.scene.allow_outside = True
    assert farm.submit(request).wait(60)["state"] == "done"
    # Errors are those of the farm
    with pytest.raises(bottega.FarmError, match="token"):
        bottega.Farm(addresses.page.split("?")[0], token="wrong").jobs()
    with pytest.raises(bottega.FarmError, match="no part by HTTP"):
        farm.render(box, output="c.exr", spp=1)
    with pytest.raises(bottega.FarmError, match="does not answer"):
        bottega.Farm("http://127.0.0.1:9")


def test_missing_farms_are_reported() -> None:
    with pytest.raises(bottega.FarmError, match="address"):
        bottega.Farm("bottega:/nowhere")
    word = "t" + "0" * 32
    with pytest.raises(bottega.FarmError):
        bottega.Farm(f"bottega://{word}@127.0.0.1:1")


def test_free_machines_render_samples_of_a_viewport(farm: bottega.Farm, box: Path) -> None:
    scene = bottega.Scene.read(box)
    expected = bottega.render(scene, spp=256, size=(24, 18)).color
    with bottega.Viewport(scene, size=(96, 72), spp=1024, threads=1, farm=farm) as viewport:
        pixels = np.empty(viewport.shape, np.float32)

        def wait_for(what: str, is_done: Any) -> None:
            end = time.monotonic() + 60
            while not is_done():
                assert time.monotonic() < end, f"{what}: {viewport.machines}, {viewport.farm_problem}"
                viewport.wait(0.1)
                viewport.frame_into(pixels)

        def is_helped() -> bool:
            return any(machine.samples_per_second > 0 for machine in viewport.machines)

        wait_for("a machine helps", is_helped)
        assert [machine["activity"] for machine in farm.machines()] == ["viewing"]
        assert viewport.machines[0].refused is None and viewport.machines[0].bytes_per_second > 0
        # Another view, and another state of the scene
        viewport.look(size=(80, 60))
        pixels = np.empty(viewport.shape, np.float32)
        scene.cameras["other"] = bottega.Camera.looking(eye=(0, 1, 3), target=(0, 1, 0))
        viewport.update()
        wait_for("a machine helps with the new state", is_helped)
        viewport.look(size=(24, 18))
        pixels = np.empty(viewport.shape, np.float32)
        frames: list[int] = []

        def rests() -> bool:
            frame = viewport.frame_into(pixels)
            frames.append(frame.samples if frame else 0)
            return frames[-1] >= 1024

        wait_for("it has all samples", rests)
        color = pixels[::-1, :, :3]
        assert abs(float(color.mean()) / float(expected.mean()) - 1) < 0.01
        assert float(np.abs(color - expected).mean()) < 0.1 * float(expected.mean())
        # A job goes first; it has a name for its picture where it is given none
        job = farm.submit(box, spp=4, size=(24, 18))
        assert (job.wait(60)["state"], job.view()["output"]) == ("done", "picture.exr")
    end = time.monotonic() + 20
    while [machine["activity"] for machine in farm.machines()] != ["waiting"] and time.monotonic() < end:
        time.sleep(0.05)
    assert [machine["activity"] for machine in farm.machines()] == ["waiting"], "it is free when the viewport is closed"


def test_a_viewport_needs_the_address_of_its_farm(addresses: Addresses, box: Path) -> None:
    page, token = addresses.page.split("/?token=")
    with pytest.raises(bottega.FarmError, match="by HTTP"):
        bottega.Viewport(bottega.Scene.read(box), farm=bottega.Farm(page, token=token))
