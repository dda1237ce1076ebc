# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles pictures by a farm that the add-on starts and joins: `farm_pictures.py FOLDER`. The mean of a still is that of Cycles alone;
what is painted is seen before; the frames of an animation are written; a job is found again, opened and cancelled."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import bottega  # noqa: E402
import bpy  # noqa: E402
import scenes  # noqa: E402
import support  # noqa: E402

PATIENCE = 240.0


def wait(what: str, is_done: object) -> None:
    begun = time.monotonic()
    while not is_done():  # type: ignore[operator]
        if time.monotonic() - begun > PATIENCE:
            farm = support.part("farm")
            support.failed(f"{what}: {farm.watch.problem}; {farm.programs.said}")
        time.sleep(0.2)
    print(f"STILL {what}: {time.monotonic() - begun:.1f} s", flush=True)


def paint(image: Any) -> None:
    """Paints half of an image, and does not save it."""
    pixels = list(image.pixels)
    pixels[: len(pixels) // 2] = [0.9, 0.1, 0.1, 1.0] * (len(pixels) // 8)
    image.pixels = pixels
    image.update()


def main() -> None:
    folder = Path(support.arguments()[0])
    support.addon()
    scenes.textured_room()
    support.addon()
    # A picture that was painted on and not saved: the farm gets it, and it is not lost here.
    image = bpy.data.images["Picture"]
    image.filepath_raw, image.file_format = str(folder / "still-picture.png"), "PNG"
    image.save()
    kept = (folder / "still-picture.png").read_bytes()
    image.unpack(method="REMOVE")
    image.source = "FILE"
    paint(image)
    # Early versions lose what is not saved when they render without a window.
    image.save()
    scene = bpy.context.scene
    support.settle(scene, 160, 120, 16)
    scene.render.engine = "CYCLES"
    alone = support.picture_of("CYCLES", folder / "still-alone.exr", 16)
    (folder / "still-picture.png").write_bytes(kept)
    paint(image)
    farm, pictures = support.part("farm"), support.part("farm_pictures")
    farm.start_farm()
    wait("the farm is there", lambda: farm._ADDRESS.search(farm.programs.said) is not None)
    farm.join_farm()
    wait("this machine is in it", lambda: len(farm.watch.machines) > 0)
    count = len(bpy.data.images)
    before = bpy.data.filepath, bpy.data.is_dirty
    still = pictures.send(scene, is_animation=False)
    if (bpy.data.filepath, bpy.data.is_dirty) != before:
        support.failed("the user's file has changed")
    if not image.is_dirty or image.packed_file or abs(image.pixels[0] - 0.9) > 0.01 or len(bpy.data.images) != count:
        support.failed("the unsaved picture has changed")
    seen = []

    def follow() -> bool:
        pictures.show(still)
        result = bpy.data.images.get(pictures.RESULT)
        if still.preview is not None and not still.is_over and result is not None:
            seen.append(float(result.pixels[0]))
        return still.is_over

    wait("the picture is done", follow)
    pictures.show(still)
    if still.state != "done, 100 %":
        support.failed(f"the job is {still.state}: {farm.watch.problem}")
    # The farm has another seed, so its noise is another one.
    difference = bottega.diff(bottega.read(still.frames[0].output).color, alone)
    off = max(abs(ratio - 1) for ratio in difference["mean_ratio"])
    print(f"STILL FLIP {difference['flip']:.4f}, mean {100 * off:.2f} % off Cycles alone, seen {len(seen)} times before", flush=True)
    if difference["flip"] > 0.05 or off > 0.005:
        support.failed("the farm's picture is another one")
    if tuple(bpy.data.images[pictures.RESULT].size) != (160, 120):
        support.failed("the picture is not open")
    animation(scene, folder)
    jobs(still.frames[0].job.number)
    farm.end_programs()
    support.leave()


def animation(scene: Any, folder: Path) -> None:
    """Renders every second of four frames into PNG files."""
    pictures = support.part("farm_pictures")
    scene.frame_start, scene.frame_end, scene.frame_step = 1, 4, 2
    scene.cycles.samples = 4
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(folder / "animation-####")
    for frame in (1, 3):
        (folder / f"animation-000{frame}.png").unlink(missing_ok=True)
    made = pictures.send(scene, is_animation=True)
    # Sent meanwhile: both must be followed to their end.
    other = pictures.send(scene, is_animation=False)

    def is_done() -> bool:
        pictures.show(made)
        return made.is_over and other.is_over and all(frame.is_shown for frame in made.frames)

    wait("the animation and a picture that was sent meanwhile are done", is_done)
    if not other.frames[0].output.is_file():
        support.failed("the picture that was sent meanwhile is not there")
    if made.state != "2 of 2 frames done":
        support.failed(f"the animation is {made.state}")
    for frame in (1, 3):
        written = bpy.data.images.load(str(folder / f"animation-000{frame}.png"))
        if tuple(written.size) != (160, 120) or max(written.pixels[: 4 * 160]) == 0.0:
            support.failed(f"frame {frame} is not there")


def jobs(number: int) -> None:
    """Opens the picture of a job by its number, as after a new start of Blender, and cancels another one."""
    farm = support.part("farm")
    wait("the job is listed", lambda: number in [view["job"] for view in farm.watch.jobs if view["kept"]])
    bpy.ops.bottega.farm_fetch(number=number)
    if tuple(bpy.data.images["Farm Result"].size) != (160, 120):
        support.failed("the picture of a job is not open")
    bpy.context.scene.cycles.samples = 4096
    bpy.context.scene.render.resolution_x = 1920
    pictures = support.part("farm_pictures")
    long = pictures.send(bpy.context.scene, is_animation=False)
    wait("a long picture is sent", lambda: long.frames[0].job is not None)
    bpy.ops.bottega.farm_cancel(number=long.frames[0].job.number)
    wait("it is cancelled", lambda: long.is_over)
    if long.frames[0].state != "cancelled":
        support.failed(f"the job is {long.frames[0].state}")


main()
