"""Interactive views of scenes in memory."""

from __future__ import annotations

import random
import time
from typing import Any

import numpy as np
import pytest

import bottega
from bottega import Camera, Material, Scene, SceneError, Viewport

from test_scenes import edit, first, fresh, square

SIZE = (24, 16)


def settled(viewport: Viewport, look: int | None, samples: int = 4) -> Any:
    """The frame of a look with all of its samples."""
    pixels = np.zeros(viewport.shape, np.float32)
    until = time.monotonic() + 120
    while time.monotonic() < until:
        viewport.wait(0.1)
        frame = viewport.frame_into(pixels)
        if frame is not None and frame.look == look and frame.samples >= samples:
            return pixels
    raise AssertionError("the look has not settled in two minutes")


def test_frames_are_linear_and_begin_with_the_lowest_row(pyramid: Scene) -> None:
    with Viewport(pyramid, size=SIZE, spp=4, threads=1) as viewport:
        pixels = settled(viewport, 0)
    expected = bottega.render(pyramid, size=SIZE, spp=4, exact=True, filter="box").color
    assert pixels.shape == (16, 24, 4) and not viewport.is_running
    # The lamp, which is above the picture, is not seen; the floor is brighter than the sky.
    assert np.isfinite(pixels).all() and abs(pixels[..., :3].mean() / expected.mean() - 1) < 0.3
    assert pixels[:4, :, :3].mean() > pixels[-4:, :, :3].mean()
    assert pixels[0, 0, 3] == 1 and pixels[-1, 0, 3] < 1, "alpha is coverage"


def test_after_any_edits_the_frame_has_the_bits_of_a_new_viewport() -> None:
    """200 edits in steps of five, each shown by a viewport that goes on, and by a new one of a scene made from the start."""
    chance = random.Random(11)
    scene = Scene()
    wanted = first(scene)
    with Viewport(scene, size=SIZE, spp=2, threads=1) as viewport:
        settled(viewport, 0, 2)
        for step in range(40):
            for _ in range(5):
                edit(chance, scene, wanted)
            continued = settled(viewport, viewport.update(), 2)
            with Viewport(fresh(wanted), size=SIZE, spp=2, threads=1) as new:
                assert (continued.view(np.uint32) == settled(new, 0, 2).view(np.uint32)).all(), f"step {step}"


def test_cameras_by_matrix_with_shift_and_region(pyramid: Scene) -> None:
    camera = pyramid.cameras["main"].copied()
    with Viewport(pyramid, size=SIZE, spp=4, threads=1) as viewport:
        whole = settled(viewport, 0)
        part = settled(viewport, viewport.look(region=(4, 2, 20, 10)))
        assert part.shape == (8, 16, 4)
        # Rows of a region count from the top, those of a frame from the bottom.
        assert (part == whole[6:14, 4:20]).all()
        camera.shift = (0.5, 0.0)
        shifted = settled(viewport, viewport.look(camera=camera))
        # The axis moves by half of half the width to the right, and the picture with it.
        assert np.abs(shifted[:, 6:, :3] - whole[:, :18, :3]).mean() < 0.3 * whole[..., :3].mean()
        assert (shifted != whole).any()
        larger = settled(viewport, viewport.look(size=(48, 32)))
        assert larger.shape == (32, 48, 4)
        assert viewport.frame_into(np.zeros((16, 24, 4), np.float32)) is None, "an array of another size waits"


def test_edits_show_after_update(pyramid: Scene) -> None:
    with Viewport(pyramid, size=SIZE, spp=4, threads=1) as viewport:
        before = settled(viewport, 0)
        pyramid.materials["orange"].base_color = (0.1, 0.1, 0.9)
        pyramid.objects["orange"].transforms = np.diag([1.0, 2.0, 1.0, 1.0])
        assert viewport.wait(0.0) in (False, True)
        look = viewport.update()
        assert look == 1 and (settled(viewport, look) != before).any()
        # A state that cannot be shown is refused; the one before stays.
        del pyramid.cameras["main"]
        with pytest.raises(bottega.Error, match="no camera"):
            viewport.update()
        assert viewport.is_running


def test_a_viewport_stops_and_starts_again(pyramid: Scene) -> None:
    viewport = Viewport(pyramid, size=SIZE, spp=4, threads=1)
    assert not viewport.is_running and viewport.update() is None and not viewport.wait(0.0)
    with pytest.raises(bottega.Error, match="does not run"):
        viewport.frame_into(np.zeros(viewport.shape, np.float32))
    viewport.start()
    first = settled(viewport, 0)
    viewport.stop()
    viewport.stop()
    pyramid.materials["orange"].base_color = (0.1, 0.1, 0.9)
    viewport.start()
    assert (settled(viewport, 0) != first).any()
    viewport.stop()


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (np.zeros((16, 24, 4), np.float64), "`array`: its dtype is float64"),
        (np.zeros((16, 24), np.float32), "`array`: its dtype is float32 and its shape"),
        (np.zeros((16, 24, 3), np.float32), r"its shape is \(16, 24, 3\)"),
        (np.zeros((16, 48, 4), np.float32)[:, ::2], "are not contiguous"),
        (np.broadcast_to(np.float32(0), (16, 24, 4)), "read-only"),
        ([[0.0]], "it is a list"),
    ],
)
def test_arrays_that_cannot_take_a_frame_are_named(array: Any, said: str) -> None:
    with Viewport(square(), size=SIZE, spp=1) as viewport, pytest.raises(SceneError, match=said):
        viewport.frame_into(array)


def test_views_that_cannot_be_are_refused() -> None:
    scene = square()
    with pytest.raises(SceneError, match="`scene` is a str"):
        Viewport("scene.glb")  # type: ignore[arg-type]
    with pytest.raises(bottega.RequestError):
        Viewport(scene, size=(0, 4)).start()
    with pytest.raises(bottega.Error, match="no camera `other`"):
        Viewport(scene, camera="other").start()
    viewport = Viewport(scene, size=SIZE, spp=1)
    with pytest.raises(SceneError, match="its matrix scales"):
        viewport.look(camera=Camera(np.diag([3.0, 3, 3, 1])))
    with pytest.raises(SceneError, match="`seconds`"):
        with viewport:
            viewport.wait(-1.0)
    assert isinstance(scene.materials["white"], Material)
