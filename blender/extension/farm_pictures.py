# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures and animations by the Cycles of a farm, and the jobs of the farm.

A copy of the scene is sent; the user's file is not changed. Each frame is a job. What is painted appears in the image *Farm Result*;
frames of an animation are written where Blender's own animation would be.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from bpy.props import IntProperty

from . import farm, library

RESULT = "Farm Result"
# Seconds between two looks at what the farm has painted.
SHOW_EVERY = 1.0
# Seconds for which frames are sent before the farm is asked for its state.
SENDING_TIME = 2.0
_GOING = ("is sent", "active", "paused")


@dataclass
class FarmFrame:
    """A frame that is a job of the farm.

    - `number`: of the frame. `output`: the file that its picture is fetched to.
    - `state`: of its job. `share`: done, 0 to 1. `is_shown`: true once Blender has the picture.
    """

    number: int
    output: Path
    job: Any = None
    state: str = "is sent"
    share: float = 0.0
    is_shown: bool = False

    @property
    def is_over(self) -> bool:
        return self.state not in _GOING


@dataclass
class FarmPicture:
    """A picture, or the frames of an animation, that the farm renders of a copy of the .blend file.

    - `preview`: the unfinished picture of the first frame that is being painted, uint8, (height, width, 3), row 0 on top.
    - `problem`: the reason why it is refused. `failure`: the number of a frame that failed, and the reason.
    """

    copy: Path
    frames: list[FarmFrame]
    samples: int
    is_animation: bool
    preview: np.ndarray | None = None
    problem: str = ""
    failure: str = ""

    @property
    def is_over(self) -> bool:
        return bool(self.problem) or all(frame.is_over for frame in self.frames)

    @property
    def state(self) -> str:
        """The state in words."""
        if self.problem:
            return f"refused: {self.problem}"
        if self.is_animation:
            done = sum(frame.state == "done" for frame in self.frames)
            failed = sum(frame.is_over for frame in self.frames) - done
            return f"{done} of {len(self.frames)} frames done" + (f", {failed} not: {self.failure}" if failed else "")
        return self.failure or f"{self.frames[0].state}, {100 * self.frames[0].share:.0f} %"


# What was sent last.
current: FarmPicture | None = None


def missing_files() -> list[str]:
    """Returns the files that the scene needs and that are not there."""
    named = [(image.filepath, image.library) for image in bpy.data.images if image.source == "FILE" and not image.packed_file]
    named += [(library_.filepath, None) for library_ in bpy.data.libraries]
    paths = [bpy.path.abspath(path, library=owner) for path, owner in named if path]
    return sorted({path for path in paths if not Path(path).is_file()})


def send(scene: Any, is_animation: bool) -> FarmPicture:
    """Sends a copy of the scene with its unsaved images, to be rendered by the Cycles of all machines. The user's file is not changed.

    Raises `RuntimeError`, which names the files that are missing.
    """
    global current
    missing = missing_files()
    if missing:
        raise RuntimeError(f"{len(missing)} files are missing: {', '.join(missing[:5])}")
    if is_animation and scene.render.is_movie_format:
        raise RuntimeError("A farm writes pictures, not movies. Choose a picture format in the output properties")
    folder = Path(tempfile.mkdtemp(prefix="bottega-farm-"))
    copy = folder / f"{Path(bpy.data.filepath).stem or 'untitled'}.blend"
    _save_copy(copy)
    numbers = range(scene.frame_start, scene.frame_end + 1, scene.frame_step) if is_animation else [scene.frame_current]
    frames = [FarmFrame(number, folder / f"{copy.stem}-{number:04}.exr") for number in numbers]
    picture = current = FarmPicture(copy, frames, scene.cycles.samples, is_animation)
    farm.watch.followers.append(lambda connected: _follow(connected, picture))
    farm.begin_watch()
    return picture


def _save_copy(copy: Path) -> None:
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


def _packed_copy(image: Any) -> Any:
    """Returns a packed image with the pixels of an unsaved one, which stays as it is."""
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


def _follow(connected: Any, picture: FarmPicture) -> bool:
    """Submits the frames, follows their jobs, and fetches what is done. Returns false when all is over. Runs in the thread of the watch."""
    import bottega

    begun = time.monotonic()
    for frame in picture.frames:
        # Many frames are sent in several rounds, so that the panel stays up to date.
        if frame.job is None and time.monotonic() < begun + SENDING_TIME:
            fields: dict[str, Any] = {"frame": frame.number} if picture.is_animation else {}
            try:
                frame.job = connected.submit(str(picture.copy), engine={"names": ["cycles"], **fields}, spp=picture.samples, output=frame.output.name)
            except (bottega.RequestError, bottega.SceneError, bottega.EngineError) as error:
                picture.problem = str(error)
                return False
            farm.own_jobs.add(frame.job.number)
    views = {view["job"]: view for view in connected.views()}
    for frame in picture.frames:
        view = views.get(frame.job.number) if frame.job is not None else None
        if frame.is_over or view is None:
            continue
        share = float(view.get("done") or 0.0)
        if view["state"] == "done":
            frame.job.fetch(frame.output)
        if view["state"] == "failed":
            picture.failure = f"frame {frame.number} failed: {view.get('reason')}"
        frame.state, frame.share = view["state"], share
        if frame.is_over:
            farm.own_jobs.discard(frame.job.number)
    going = next((frame for frame in picture.frames if not frame.is_over and frame.job is not None and frame.share > 0.0), None)
    picture.preview = going.job.preview() if going is not None else None
    return not picture.is_over


def show(picture: FarmPicture) -> float | None:
    """Shows what has come of a picture; Blender calls it again after the seconds that it returns."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in ("PROPERTIES", "IMAGE_EDITOR"):
                area.tag_redraw()
    is_over, preview = picture.is_over, picture.preview
    for frame in picture.frames:
        if frame.state == "done" and not frame.is_shown:
            frame.is_shown = True
            _take(picture, frame)
    if preview is not None and not is_over:
        _show_preview(preview)
    return None if is_over else SHOW_EVERY


def _take(picture: FarmPicture, frame: FarmFrame) -> None:
    """Opens the picture of a frame, and writes that of an animation, by the view of the scene."""
    image = _result(frame.output)
    if picture.is_animation:
        scene = bpy.context.scene
        image.save_render(bpy.path.abspath(scene.render.frame_path(frame=frame.number)), scene=scene)


def _result(path: Path) -> Any:
    """Returns the image *Farm Result* with the pixels of a file."""
    old = bpy.data.images.get(RESULT)
    image = bpy.data.images.load(str(path))
    if old is not None:
        old.user_remap(image)
        bpy.data.images.remove(old)
    image.name = RESULT
    return image


def _show_preview(preview: np.ndarray) -> None:
    height, width = preview.shape[:2]
    image = bpy.data.images.get(RESULT)
    if image is None or image.source != "GENERATED" or tuple(image.size) != (width, height):
        made = bpy.data.images.new(RESULT, width, height)
        if image is not None:
            image.user_remap(made)
            bpy.data.images.remove(image)
        image = made
        image.name = RESULT
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = preview[::-1] / np.float32(255)
    image.pixels.foreach_set(pixels.ravel())
    image.update()


def left_out(scene: Any) -> list[str]:
    """Returns the settings of a scene that the Cycles of a farm leaves out."""
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


def _send_and_show(context: Any, is_animation: bool) -> None:
    picture = send(context.scene, is_animation)
    bpy.app.timers.register(lambda: show(picture), first_interval=SHOW_EVERY)


class BOTTEGA_OT_farm_still(farm.FarmOperator, bpy.types.Operator):
    """Render the picture by the Cycles of all machines of the farm. Blender stays usable"""

    bl_idname = "bottega.farm_still"
    bl_label = "Picture"

    def act(self, context: Any) -> None:
        _send_and_show(context, is_animation=False)


class BOTTEGA_OT_farm_animation(farm.FarmOperator, bpy.types.Operator):
    """Render the frames of the scene by the Cycles of all machines of the farm, into the output path. Blender stays usable"""

    bl_idname = "bottega.farm_animation"
    bl_label = "Animation"

    def act(self, context: Any) -> None:
        _send_and_show(context, is_animation=True)


class BOTTEGA_OT_farm_fetch(farm.FarmOperator, bpy.types.Operator):
    """Open the picture of this job as the image Farm Result"""

    bl_idname = "bottega.farm_fetch"
    bl_label = "Open"
    number: IntProperty(name="Job")

    def act(self, context: Any) -> None:
        import bottega

        job = bottega.Farm(farm.address()).job(self.number)
        suffix = Path(job.view()["output"]).suffix or ".exr"
        _result(job.fetch(Path(tempfile.mkdtemp(prefix="bottega-farm-")) / f"job-{self.number}{suffix}"))


class BOTTEGA_OT_farm_cancel(farm.FarmOperator, bpy.types.Operator):
    """Cancel this job"""

    bl_idname = "bottega.farm_cancel"
    bl_label = "Cancel"
    number: IntProperty(name="Job")

    def act(self, context: Any) -> None:
        import bottega

        bottega.Farm(farm.address()).job(self.number).cancel()


class _FarmPanel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_parent_id = "BOTTEGA_PT_farm"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return library.problem() is None


class BOTTEGA_PT_farm_cycles(_FarmPanel, bpy.types.Panel):
    """Pictures by the Cycles of the farm."""

    bl_label = "By the Cycles of the Farm"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.engine == "CYCLES" and library.problem() is None

    def draw(self, context: Any) -> None:
        layout = self.layout
        notes = left_out(context.scene)
        if notes:
            layout.label(text=f"The farm leaves out: {', '.join(notes)}", icon="INFO")
        row = layout.row(align=True)
        row.operator("bottega.farm_still", icon="RENDER_STILL")
        row.operator("bottega.farm_animation", icon="RENDER_ANIMATION")
        if current is not None:
            layout.label(text=current.state, icon="ERROR" if current.problem or current.failure else "NONE")


class BOTTEGA_PT_farm_jobs(_FarmPanel, bpy.types.Panel):
    """The last jobs of the farm, also those of a Blender that has ended."""

    bl_label = "Jobs"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layout = self.layout
        if not farm.watch.jobs:
            layout.label(text="No job, or the farm was not found yet")
        for view in farm.watch.jobs:
            row = layout.row(align=True)
            share = f" {100 * (view.get('done') or 0.0):.0f} %" if view["state"] in _GOING else ""
            row.label(text=f"{view['job']}: {view['scene']}, {view['state']}{share}")
            if view["state"] in _GOING:
                row.operator("bottega.farm_cancel", icon="X").number = view["job"]
            elif view["kept"]:
                row.operator("bottega.farm_fetch", icon="IMAGE_DATA").number = view["job"]


_CLASSES = (
    BOTTEGA_OT_farm_still,
    BOTTEGA_OT_farm_animation,
    BOTTEGA_OT_farm_fetch,
    BOTTEGA_OT_farm_cancel,
    BOTTEGA_PT_farm_cycles,
    BOTTEGA_PT_farm_jobs,
)


def register() -> None:
    for cls in _CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
