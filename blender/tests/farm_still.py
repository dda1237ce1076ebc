# SPDX-License-Identifier: GPL-3.0-or-later
"""A Cycles still by a farm that the add-on starts and joins: `farm_still.py FOLDER`. Its mean is that of Cycles alone."""

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
    farm = support.part("farm")
    farm.start_farm()
    wait("the farm is there", lambda: farm._ADDRESS.search(farm.programs.said) is not None)
    farm.join_farm()
    wait("this machine is in it", lambda: len(farm.watch.machines) > 0)
    count = len(bpy.data.images)
    before = bpy.data.filepath, bpy.data.is_dirty
    still = farm.send_still()
    if (bpy.data.filepath, bpy.data.is_dirty) != before:
        support.failed("the user's file has changed")
    if not image.is_dirty or image.packed_file or abs(image.pixels[0] - 0.9) > 0.01 or len(bpy.data.images) != count:
        support.failed("the unsaved picture has changed")
    wait("the picture is done", lambda: still.is_over)
    farm.end_programs()
    if still.state != "done":
        support.failed(f"the job is {still.state}: {farm.watch.problem}")
    # The farm has another seed, so its noise is another one.
    difference = bottega.diff(bottega.read(still.output).color, alone)
    off = max(abs(ratio - 1) for ratio in difference["mean_ratio"])
    print(f"STILL FLIP {difference['flip']:.4f}, mean {100 * off:.2f} % off Cycles alone", flush=True)
    if difference["flip"] > 0.05 or off > 0.005:
        support.failed("the farm's picture is another one")
    support.leave()


main()
