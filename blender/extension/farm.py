# SPDX-License-Identifier: GPL-3.0-or-later
"""A farm: started here, found, joined, and watched.

Programs run beside Blender; a thread asks the farm for its state, so that Blender stays usable. The address of the farm, which holds
its word, is kept in the preferences of the add-on, never in the .blend file.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import re
import subprocess
import threading
import time
from dataclasses import dataclass, field
from typing import Any, Callable

import bpy
from bpy.props import BoolProperty, StringProperty

from . import library

# Seconds between two questions to the farm.
ASK_EVERY = 1.0
# Largest number of jobs that the panel shows.
JOBS_SHOWN = 6
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
class Watch:
    """What is known of the farm. The thread that asks it writes here, and the panel reads."""

    machines: list[dict[str, Any]] = field(default_factory=list)
    # The last jobs, the newest first.
    jobs: list[dict[str, Any]] = field(default_factory=list)
    # Farms on the local network: machine and address of each.
    found: list[str] = field(default_factory=list)
    # Called with the farm after each question to it, in the thread of the watch, until they return false.
    followers: list[Callable[[Any], bool]] = field(default_factory=list)
    problem: str = ""
    address: str | None = None
    thread: threading.Thread | None = None
    is_wanted: bool = False


programs = Programs()
watch = Watch()
# Numbers of the jobs that this Blender has sent and that are not over.
own_jobs: set[int] = set()


class BottegaPreferences(bpy.types.AddonPreferences):
    """Preferences of the add-on."""

    bl_idname = __package__

    address: StringProperty(name="Farm", description="The line that `bottega up` prints, or its word alone; empty: the farm on this machine", default="", subtype="PASSWORD")
    outlives: BoolProperty(name="Stay in the farm after Blender ends", default=False)
    keeps_jobs: BoolProperty(name="Finish pictures after Blender ends", description="Off: jobs of this Blender are cancelled when it ends", default=True)

    def draw(self, context: Any) -> None:
        self.layout.prop(self, "address")
        self.layout.prop(self, "outlives")
        self.layout.prop(self, "keeps_jobs")


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
    if kept is not None and not kept.keeps_jobs:
        _cancel_jobs()
    if kept is None or not kept.outlives:
        programs.end()


def _cancel_jobs() -> None:
    """Cancels the jobs that this Blender has sent."""
    if not own_jobs:
        return
    import bottega

    with contextlib.suppress(bottega.Error):
        connected = bottega.Farm(address())
        for number in list(own_jobs):
            # One that has just ended cannot be cancelled.
            with contextlib.suppress(bottega.Error):
                connected.job(number).cancel()


def begin_watch() -> None:
    """Begins to ask the farm how it stands."""
    watch.is_wanted, watch.address = True, address()
    if watch.thread is None or not watch.thread.is_alive():
        watch.thread = threading.Thread(target=_ask, name="bottega farm", daemon=True)
        watch.thread.start()


def _ask() -> None:
    import bottega

    connected, where = None, watch.address
    while watch.is_wanted:
        try:
            if connected is None or where != watch.address:
                where = watch.address
                connected = bottega.Farm(where)
            watch.machines = connected.machines()
            watch.jobs = connected.views()[-JOBS_SHOWN:][::-1]
            watch.found, watch.problem = [], ""
            for follow in list(watch.followers):
                if not follow(connected):
                    watch.followers.remove(follow)
        except bottega.Error as error:
            watch.problem, connected = str(error), None
            with contextlib.suppress(bottega.FarmError):
                watch.found = [f"{found.host}, {found.address}" for found in bottega.farms(FIND_TIME)]
        time.sleep(ASK_EVERY)


class FarmOperator:
    """An operator whose `act` raises `RuntimeError`, `OSError` or an error of `bottega` with what the user should read."""

    def execute(self, context: Any) -> set[str]:
        import bottega

        try:
            self.act(context)
        except (RuntimeError, OSError, bottega.Error) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class BOTTEGA_OT_farm_start(FarmOperator, bpy.types.Operator):
    """Start a farm on this machine: others join it by the line that is shown"""

    bl_idname = "bottega.farm_start"
    bl_label = "Start a Farm Here"

    def act(self, context: Any) -> None:
        start_farm()


class BOTTEGA_OT_farm_join(FarmOperator, bpy.types.Operator):
    """Let this machine render the jobs of the farm"""

    bl_idname = "bottega.farm_join"
    bl_label = "Join This Machine"

    def act(self, context: Any) -> None:
        join_farm()


class BOTTEGA_OT_farm_look(FarmOperator, bpy.types.Operator):
    """Look for the farm, and show its machines"""

    bl_idname = "bottega.farm_look"
    bl_label = "Find the Farm"

    def act(self, context: Any) -> None:
        begin_watch()


class BOTTEGA_OT_farm_copy(FarmOperator, bpy.types.Operator):
    """Copy the line by which other machines join. It holds the secret of the farm"""

    bl_idname = "bottega.farm_copy"
    bl_label = "Copy the Line for Others"

    def act(self, context: Any) -> None:
        line = _ADDRESS.search(programs.said)
        context.window_manager.clipboard = line.group(0) if line is not None else ""


class BOTTEGA_PT_farm(bpy.types.Panel):
    """The farm and its machines."""

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
        column = layout.column(align=True)
        column.operator("bottega.farm_look")
        column.operator("bottega.farm_start")
        column.operator("bottega.farm_join")
        if kept is not None:
            layout.prop(kept, "outlives")
            layout.prop(kept, "keeps_jobs")
        line = _ADDRESS.search(programs.said)
        if line is not None:
            layout.label(text=line.group(0))
            layout.operator("bottega.farm_copy", icon="COPYDOWN")
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
        if context.engine == "BOTTEGA":
            layout.prop(context.scene.bottega, "use_farm")
            layout.prop(context.scene.bottega, "view_farm")
            layout.prop(context.scene.bottega, "priority")
            if context.scene.bottega.use_farm and context.scene.bottega.goal == "TIME":
                layout.label(text="A farm keeps no time. Finish at noise or samples", icon="ERROR")


_CLASSES = (
    BottegaPreferences,
    BOTTEGA_OT_farm_start,
    BOTTEGA_OT_farm_join,
    BOTTEGA_OT_farm_look,
    BOTTEGA_OT_farm_copy,
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
