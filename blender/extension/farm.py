# SPDX-License-Identifier: GPL-3.0-or-later
"""A farm: started here, joined, and Cycles stills over all of its machines.

Programs run beside Blender; a thread asks the farm how it stands, so that Blender stays usable. The address of the farm, which holds
its word, is kept in the preferences of the add-on, never in the .blend file.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import re
import subprocess
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, StringProperty

from . import library

# Seconds between two questions to the farm.
ASK_EVERY = 1.0
# Seconds for which farms on the local network are searched.
FIND_TIME = 2.0
_ADDRESS = re.compile(r"bottega://\S+@\S+")


@dataclass
class Programs:
    """The programs that this Blender has started, and what they said."""

    up: subprocess.Popen[str] | None = None
    join: subprocess.Popen[str] | None = None
    said: str = ""

    def end(self) -> None:
        """Ends those that shall not outlive Blender."""
        for program in (self.up, self.join):
            if program is not None and program.poll() is None:
                program.terminate()


@dataclass
class Still:
    """A picture that a farm renders of a copy of the .blend file."""

    copy: Path
    output: Path
    samples: int
    job: Any = None
    state: str = "is sent"
    share: float = 0.0
    is_over: bool = False


@dataclass
class Watch:
    """What is known of the farm. The thread that asks it writes here, and the panel reads."""

    machines: list[dict[str, Any]] = field(default_factory=list)
    # Farms on the local network: machine and address of each.
    found: list[str] = field(default_factory=list)
    still: Still | None = None
    problem: str = ""
    address: str | None = None
    thread: threading.Thread | None = None
    is_wanted: bool = False


programs = Programs()
watch = Watch()


class BottegaPreferences(bpy.types.AddonPreferences):
    """Preferences of the add-on."""

    bl_idname = __package__

    address: StringProperty(name="Farm", description="The line that `bottega up` prints, or its word alone; empty: the farm on this machine", default="", subtype="PASSWORD")
    outlives: BoolProperty(name="Stay in the farm after Blender ends", default=False)

    def draw(self, context: Any) -> None:
        self.layout.prop(self, "address")
        self.layout.prop(self, "outlives")


def preferences() -> Any:
    """Returns the preferences; those of a Blender in which the add-on is not installed are the defaults."""
    addon = bpy.context.preferences.addons.get(__package__)
    return addon.preferences if addon is not None else None


def address() -> str | None:
    """Returns the address of the farm; `None`: the one on this machine."""
    kept = preferences()
    return (kept.address.strip() or None) if kept is not None else None


def environment() -> dict[str, str]:
    """Returns the environment of programs: this Blender renders what the farm asks of Cycles."""
    values = dict(os.environ)
    if bpy.app.binary_path:
        values.setdefault("BOTTEGA_BLENDER", bpy.app.binary_path)
    for name in ("PYTHONPATH", "PYTHONHOME"):
        values.pop(name, None)
    return values


def start_farm() -> None:
    """Starts a farm on this machine. Raises `RuntimeError`."""
    program, server = library.program("bottega"), library.program("nats-server")
    if program is None:
        raise RuntimeError("The program bottega is not in the extension. Install the extension again")
    if programs.up is not None and programs.up.poll() is None:
        return
    command = [str(program), "up"]
    if server is not None:
        command += ["--server", str(server)]
    programs.up = _started(command)
    threading.Thread(target=_listen, args=(programs.up,), daemon=True).start()
    begin_watch()


def _started(command: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command, env=environment(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )


def _listen(program: subprocess.Popen[str]) -> None:
    """Keeps what a program says; the page's address is in it."""
    assert program.stdout is not None
    for line in program.stdout:
        programs.said = (programs.said + line)[-4000:]


def failure() -> str:
    """Returns the last words of a program that has ended with an error; empty: none has."""
    ended = [program for program in (programs.up, programs.join) if program is not None and (program.poll() or 0) > 0]
    lines = programs.said.strip().splitlines()
    return lines[-1] if ended and lines else "The program bottega has ended with an error" if ended else ""


def join_farm() -> None:
    """Offers this machine to the farm. Raises `RuntimeError`."""
    program = library.program("bottega")
    if program is None:
        raise RuntimeError("The program bottega is not in the extension. Install the extension again")
    if programs.join is None or programs.join.poll() is not None:
        where = address()
        programs.join = _started([str(program), "join", *([where] if where else [])])
        threading.Thread(target=_listen, args=(programs.join,), daemon=True).start()
    begin_watch()


def end_programs() -> None:
    """Ends what was started, unless it shall outlive Blender."""
    watch.is_wanted = False
    kept = preferences()
    if kept is None or not kept.outlives:
        programs.end()


def begin_watch() -> None:
    """Begins to ask the farm how it stands."""
    watch.is_wanted, watch.address = True, address()
    if watch.thread is None or not watch.thread.is_alive():
        watch.thread = threading.Thread(target=_ask, name="bottega farm", daemon=True)
        watch.thread.start()


def _ask() -> None:
    import bottega

    farm, where = None, watch.address
    while watch.is_wanted:
        try:
            if farm is None or where != watch.address:
                where = watch.address
                farm = bottega.Farm(where)
            watch.machines = farm.machines()
            _follow(farm)
            watch.problem = "" if watch.still is None or watch.still.state == "done" or not watch.still.is_over else watch.problem
            watch.found = []
        except bottega.Error as error:
            watch.problem, farm = str(error), None
            with contextlib.suppress(bottega.FarmError):
                watch.found = [f"{found.host}, {found.address}" for found in bottega.farms(FIND_TIME)]
        time.sleep(ASK_EVERY)


def _follow(farm: Any) -> None:
    """Sends the still, follows it, and fetches its picture."""
    still = watch.still
    if still is None or still.is_over:
        return
    if still.job is None:
        import bottega

        try:
            still.job = farm.submit(str(still.copy), engine={"names": ["cycles"]}, spp=still.samples, output=str(still.output))
        except (bottega.RequestError, bottega.SceneError, bottega.EngineError):
            still.state, still.is_over = "is refused", True
            raise
    view = still.job.view()
    still.state, still.share = view["state"], float(view.get("done") or 0.0)
    if still.state == "done":
        still.job.fetch(still.output)
    still.is_over = still.state not in ("active", "paused")
    if still.state == "failed":
        watch.problem = str(view.get("reason"))


def missing_files() -> list[str]:
    """Returns the files that the scene needs and that are not there."""
    named = [(image.filepath, image.library) for image in bpy.data.images if image.source == "FILE" and not image.packed_file]
    named += [(library_.filepath, None) for library_ in bpy.data.libraries]
    paths = [bpy.path.abspath(path, library=owner) for path, owner in named if path]
    return sorted({path for path in paths if not Path(path).is_file()})


def send_still() -> Still:
    """Sends a copy of the scene, with its unsaved pictures, to be rendered by the Cycles of all machines. The user's file is untouched.

    Raises `RuntimeError`, which names the files that are missing.
    """
    missing = missing_files()
    if missing:
        raise RuntimeError(f"{len(missing)} files are missing: {', '.join(missing[:5])}")
    folder = Path(tempfile.mkdtemp(prefix="bottega-still-"))
    copy = folder / "scene.blend"
    unsaved = [image for image in bpy.data.images if image.is_dirty and image.has_data and image.source in ("FILE", "GENERATED")]
    copies = [_packed_copy(image) for image in unsaved]
    for image, other in zip(unsaved, copies):
        image.user_remap(other)
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(copy), copy=True, compress=True, relative_remap=False)
    finally:
        for image, other in zip(unsaved, copies):
            other.user_remap(image)
            bpy.data.images.remove(other)
    watch.still = Still(copy, folder / "picture.exr", bpy.context.scene.cycles.samples)
    begin_watch()
    return watch.still


def _packed_copy(image: Any) -> Any:
    """Returns a packed image with the pixels of an unsaved one, which stays as it is."""
    import numpy as np

    width, height = image.size
    other = bpy.data.images.new(image.name, width, height, alpha=True, float_buffer=image.is_float)
    other.colorspace_settings.name = image.colorspace_settings.name
    other.alpha_mode = image.alpha_mode
    flat = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(flat)
    pixels = np.ones((width * height, 4), np.float32)
    pixels[:, : image.channels] = flat.reshape(-1, image.channels)
    other.pixels.foreach_set(pixels.ravel())
    other.update()
    other.pack()
    return other


def left_out(scene: Any) -> list[str]:
    """Returns what the Cycles of a farm leaves out of a scene."""
    notes = []
    if scene.cycles.device != "CPU":
        notes.append("GPUs")
    if scene.cycles.use_adaptive_sampling:
        notes.append("adaptive sampling")
    if scene.use_nodes:
        notes.append("the compositor")
    if len([layer for layer in scene.view_layers if layer.use]) > 1:
        notes.append("further view layers")
    return notes


class _FarmOperator:
    def execute(self, context: Any) -> set[str]:
        try:
            self.act(context)
        except (RuntimeError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class BOTTEGA_OT_farm_start(_FarmOperator, bpy.types.Operator):
    """Start a farm on this machine: others join it by the line that is shown"""

    bl_idname = "bottega.farm_start"
    bl_label = "Start a Farm Here"

    def act(self, context: Any) -> None:
        start_farm()


class BOTTEGA_OT_farm_join(_FarmOperator, bpy.types.Operator):
    """Let this machine render the jobs of the farm"""

    bl_idname = "bottega.farm_join"
    bl_label = "Join This Machine"

    def act(self, context: Any) -> None:
        join_farm()


class BOTTEGA_OT_farm_look(_FarmOperator, bpy.types.Operator):
    """Look for the farm, and show its machines"""

    bl_idname = "bottega.farm_look"
    bl_label = "Find the Farm"

    def act(self, context: Any) -> None:
        begin_watch()


class BOTTEGA_OT_farm_still(_FarmOperator, bpy.types.Operator):
    """Render the picture by the Cycles of all machines of the farm. Blender stays usable"""

    bl_idname = "bottega.farm_still"
    bl_label = "Render by the Cycles of the Farm"

    def act(self, context: Any) -> None:
        still = send_still()
        bpy.app.timers.register(lambda: _show(still), first_interval=ASK_EVERY)


def _show(still: Still) -> float | None:
    """Redraws the panel while a still is rendered, and opens its picture at the end. Blender calls it again after the seconds."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()
    if not still.is_over:
        return ASK_EVERY
    if still.output.is_file():
        image = bpy.data.images.load(str(still.output))
        image.name = "Farm Result"
    return None


class BOTTEGA_PT_farm(bpy.types.Panel):
    """Machines of the farm, and stills by their Cycles."""

    bl_label = "Bottega Farm"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.engine in ("BOTTEGA", "CYCLES")

    def draw(self, context: Any) -> None:
        layout = self.layout
        problem = library.problem()
        if problem is not None:
            layout.label(text=problem, icon="ERROR")
            return
        kept = preferences()
        if kept is not None:
            layout.prop(kept, "address")
        row = layout.row(align=True)
        row.operator("bottega.farm_look")
        row.operator("bottega.farm_start")
        row.operator("bottega.farm_join")
        if kept is not None:
            layout.prop(kept, "outlives")
        line = _ADDRESS.search(programs.said)
        if line is not None:
            layout.label(text="Others join by this line, which is the farm's secret:")
            layout.label(text=line.group(0))
        page = re.search(r"https?://\S+", programs.said)
        if page is not None:
            layout.operator("wm.url_open", text="Open the Page", icon="URL").url = page.group(0)
        for problem in (failure(), watch.problem):
            if problem:
                layout.label(text=problem, icon="ERROR")
        for found in watch.found:
            layout.label(text=f"On this network: {found}. Paste the word or the line of its `bottega up`", icon="WORLD")
        for machine in watch.machines:
            text = f"{machine['machine']}: {machine['state']}, {machine['threads']} processors, Bottega {machine['version']}"
            layout.label(text=text, icon="DESKTOP")
        if context.engine == "CYCLES":
            self._draw_still(context)
        else:
            layout.prop(context.scene.bottega, "use_farm")
            layout.prop(context.scene.bottega, "view_farm")
            if context.scene.bottega.use_farm and context.scene.bottega.goal == "TIME":
                layout.label(text="A farm keeps no time. Finish at noise or samples", icon="ERROR")

    def _draw_still(self, context: Any) -> None:
        layout = self.layout
        notes = left_out(context.scene)
        if notes:
            layout.label(text=f"The farm leaves out: {', '.join(notes)}", icon="INFO")
        layout.operator("bottega.farm_still", icon="RENDER_STILL")
        still = watch.still
        if still is not None:
            layout.label(text=f"The picture {still.state}: {100 * still.share:.0f} %")


_CLASSES = (
    BottegaPreferences,
    BOTTEGA_OT_farm_start,
    BOTTEGA_OT_farm_join,
    BOTTEGA_OT_farm_look,
    BOTTEGA_OT_farm_still,
    BOTTEGA_PT_farm,
)


def register() -> None:
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    atexit.register(end_programs)


def unregister() -> None:
    end_programs()
    atexit.unregister(end_programs)
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
