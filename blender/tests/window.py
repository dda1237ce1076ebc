# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewport in a window, by script: turn, edit, undo; with a farm. `window.py FOLDER` needs a display.

Each step waits until the view shows it, and writes a screenshot. Prints how long the first pixels of each step took.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any, Callable, Iterator

sys.path.insert(0, str(Path(__file__).parent))

import bpy  # noqa: E402
import mathutils  # noqa: E402
import support  # noqa: E402

# Seconds after which a step has failed.
PATIENCE = 60.0


def area() -> Any:
    return next(area for area in bpy.context.window_manager.windows[0].screen.areas if area.type == "VIEW_3D")


def view() -> Any:
    """Returns what the engine of the 3D view shows; `None`: it has not drawn yet."""
    views = list(support.part("view").View._all)
    return views[-1] if views else None


def look() -> int:
    """Returns the number of the look that is drawn; -1: none."""
    shown = view()
    return shown._frame.look if shown is not None and shown._frame is not None else -1


def frame_number() -> int:
    shown = view()
    return shown._frame.number if shown is not None and shown._frame is not None else -1


def screenshot(folder: Path, name: str) -> None:
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area()):
        bpy.ops.screen.screenshot(filepath=str(folder / f"window-{name}.png"))


def steps(folder: Path) -> Iterator[Callable[[], bool]]:
    """Yields, after each thing that it does, a condition to wait for."""
    support.addon()
    scene = bpy.context.scene
    scene.render.engine = "BOTTEGA"
    scene.bottega.view_samples = 64
    space = area().spaces[0]
    space.shading.type = "RENDERED"
    yield report("start", lambda: look() >= 0)
    yield lambda: view()._frame.samples >= 64
    screenshot(folder, "start")

    for turn in range(8):
        before = look()
        space.region_3d.view_rotation = space.region_3d.view_rotation @ mathutils.Quaternion((0.0, 1.0, 0.0), 0.1)
        yield report("turn", lambda before=before: look() > before)
    before = look()
    bpy.data.materials["Material"].node_tree.nodes["Principled BSDF"].inputs[0].default_value = (0.8, 0.1, 0.1, 1.0)
    yield report("material", lambda: look() > before)
    yield lambda: view()._frame.samples >= 16
    screenshot(folder, "material")

    before = look()
    bpy.ops.ed.undo_push(message="before")
    bpy.data.objects["Cube"].location.z += 1.0
    bpy.ops.ed.undo_push(message="move")
    yield report("move", lambda: look() > before)
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area(), region=area().regions[-1]):
        bpy.ops.ed.undo()
    before = look()
    yield report("undo", lambda: look() != before)
    yield lambda: view()._frame.samples >= 16
    screenshot(folder, "undo")
    before = look()
    bpy.data.objects.remove(bpy.data.objects["Light"])
    yield report("last light", lambda: look() != before)
    area().spaces[0].shading.type = "SOLID"
    yield lambda: True
    area().spaces[0].shading.type = "RENDERED"
    yield lambda: look() >= 0
    screenshot(folder, "again")
    yield from farm_steps(folder)


def farm_steps(folder: Path) -> Iterator[Callable[[], bool]]:
    """Yields the steps with a farm on this machine, whose only machine helps the viewport."""
    farm = support.part("farm")
    if support.part("library").program("bottega") is None:
        print("WINDOW SKIPPED: the program bottega is not beside the module", flush=True)
        return
    farm.start_farm()
    yield lambda: farm._ADDRESS.search(farm.programs.said) is not None
    farm.join_farm()
    # Undo has made other data
    scene = bpy.context.scene
    scene.bottega.view_samples = 65536
    scene.bottega.view_farm = True
    yield report("a machine helps", helps)
    area().spaces[0].region_3d.view_rotation = area().spaces[0].region_3d.view_rotation @ mathutils.Quaternion((0.0, 1.0, 0.0), 0.4)
    yield report("it helps with another view", helps)
    yield lambda: view()._frame.samples >= 8
    print(f"WINDOW {view()._frame.samples} samples{view()._help()}", flush=True)
    screenshot(folder, "farm")
    farm.end_programs()


def helps() -> bool:
    """Returns true if a machine of the farm sends samples."""
    shown = view()
    machines = shown.viewport.machines if shown is not None and shown.viewport is not None else []
    return any(machine.samples_per_second > 0 for machine in machines)


def report(name: str, is_done: Callable[[], bool]) -> Callable[[], bool]:
    """Wraps a condition, so that the time until it holds is printed."""
    begun = time.perf_counter()

    def wrapped() -> bool:
        if not is_done():
            return False
        print(f"WINDOW {name}: {1000 * (time.perf_counter() - begun):.0f} ms", flush=True)
        return True

    return wrapped


class State:
    waits: Callable[[], bool] = staticmethod(lambda: True)
    since = 0.0


def tick(run: Iterator[Callable[[], bool]]) -> float | None:
    """Goes on with the steps when the condition holds. Blender calls it again after the returned seconds."""
    try:
        if not State.waits():
            if time.perf_counter() - State.since > PATIENCE:
                support.failed("the view does not show a step")
            return 0.005
        State.waits, State.since = next(run), time.perf_counter()
        return 0.005
    except StopIteration:
        print("WINDOW done", flush=True)
        support.leave()
    except Exception as error:
        import traceback

        traceback.print_exc()
        support.failed(str(error))
    return None


def main() -> None:
    bpy.context.preferences.view.show_splash = False
    run = steps(Path(support.arguments()[0]))
    bpy.app.timers.register(lambda: tick(run), first_interval=1.0)


main()
