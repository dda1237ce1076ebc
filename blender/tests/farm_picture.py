# SPDX-License-Identifier: GPL-3.0-or-later
"""F12 over a farm that the add-on starts and two machines join: `farm_picture.py FOLDER`.

The bits are those of F12 alone and of the command line, also if a machine is killed meanwhile.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, Callable

sys.path.insert(0, str(Path(__file__).parent))

import bottega  # noqa: E402
import bpy  # noqa: E402
import numpy as np  # noqa: E402
import scenes  # noqa: E402
import support  # noqa: E402

PATIENCE = 120.0


def wait(what: str, is_done: Callable[[], bool]) -> None:
    begun = time.monotonic()
    while not is_done():
        if time.monotonic() - begun > PATIENCE:
            farm = support.part("farm")
            support.failed(f"{what}: {farm.watch.problem}; {farm.programs.said}")
        time.sleep(0.1)
    print(f"FARM {what}: {time.monotonic() - begun:.1f} s", flush=True)


def layers_of(file: Path) -> dict[str, Any]:
    """Returns the passes of a picture that Blender has written."""
    picture = bottega.read(file)
    return {name: np.array(picture[name]) for name in picture.layers}


def picture(folder: Path, name: str, samples: int, on_farm: bool) -> dict[str, Any]:
    """Renders the scene as F12 does."""
    bpy.context.scene.bottega.use_farm = on_farm
    file = folder / f"farm-{name}.exr"
    begun = time.monotonic()
    support.picture_of("BOTTEGA", file, samples)
    print(f"FARM {name}: {time.monotonic() - begun:.1f} s", flush=True)
    return layers_of(file)


def compare(name: str, alone: dict[str, Any], other: dict[str, Any]) -> None:
    for layer, values in alone.items():
        if layer not in other or not support.is_same(values, other[layer]):
            support.failed(f"{name}: the layer {layer} has other bits")


def settle_passes(scene: Any) -> None:
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = True
    scene.bottega.use_albedo = True


def kill_when_painting(address: str, machine: Any, has_died: threading.Event) -> None:
    """Kills a machine as soon as two have a job."""
    farm = bottega.Farm(address)
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if sum(known["job"] is not None for known in farm.machines()) >= 2:
            os.kill(machine.pid, signal.SIGKILL)
            has_died.set()
            return
        time.sleep(0.05)


def command_line(folder: Path, program: Path) -> dict[str, Any]:
    """Writes the scene, and renders it by the program."""
    file, output = folder / "farm.bottega", folder / "farm-line.exr"
    if bpy.ops.bottega.save_scene(filepath=str(file)) != {"FINISHED"}:
        support.failed("the scene cannot be written")
    subprocess.run([str(program), "render", str(file), "-o", str(output)], check=True, stdout=subprocess.DEVNULL)
    return layers_of(output)


def main() -> None:
    folder = Path(support.arguments()[0])
    support.addon()
    scenes.textured_room()
    scene = bpy.context.scene
    support.settle(scene, 320, 240, 16)
    settle_passes(scene)
    # What only the viewport shows is neither rendered nor written.
    scenes.cube((0, -1, 1)).hide_render = True
    alone = picture(folder, "alone", 16, False)
    farm, library = support.part("farm"), support.part("library")
    program = library.program("bottega")
    farm.start_farm()
    wait("the farm is there", lambda: farm._ADDRESS.search(farm.programs.said) is not None)
    farm.join_farm()
    address = farm._ADDRESS.search(farm.programs.said).group(0)
    second = subprocess.Popen(
        [str(program), "join", address, "--threads", "1"], env=farm.environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    support.STARTED.append(second)
    try:
        wait("two machines are in it", lambda: len(farm.watch.machines) >= 2)
        compare("farm", alone, picture(folder, "all", 16, True))
        line = command_line(folder, program)
        compare("the command line", {"color": alone["color"]}, line)
        longer = picture(folder, "longer-alone", 96, False)
        has_died = threading.Event()
        threading.Thread(target=kill_when_painting, args=(address, second, has_died), daemon=True).start()
        compare("a machine was killed", longer, picture(folder, "longer", 96, True))
        if not has_died.is_set():
            support.failed("no machine has died")
    finally:
        second.kill()
        farm.end_programs()
    support.leave()


main()
