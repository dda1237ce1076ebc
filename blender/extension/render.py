# SPDX-License-Identifier: GPL-3.0-or-later
"""F12: the scene of Blender becomes a picture, pass by pass."""

from __future__ import annotations

import math
import threading
import time
from typing import Any

import bottega
import bpy
import numpy as np

from .export import Export
from .export.camera import Eye, Frame, camera_keys, camera_of, frame_of
from .export.moments import Clock, Motion, camera_matrix, follow, lens_of
from .export.report import Fidelity, Report
from .export.shutter import rolling_shutter_of, shutter_of
from .final import Finish, Layers, PassInfo, crop_of, note_passes, passes_of, pixels_of, request_fields
from .work import Work, work_for

# Seconds between looks at whether the user has pressed Escape.
LOOK_EVERY = 0.05
# Seconds between two updates of the picture that Blender shows, and the share of the time that they may take.
SHOW_EVERY = 0.5
SHOW_SHARE = 0.02
# What a preview of a material is like, whatever the scene says: it must be there at once.
PREVIEW: dict[str, Any] = {"goal": {"samples": 24}, "max_depth": 6, "denoise": False, "guide": {"by": "none"}}


class Kept:
    """The export of an animation whose scene Blender keeps between frames (Persistent Data), by name of the scene."""

    exports: dict[str, Export] = {}
    last_report: Report = Report()
    # The file that scenes are written to instead of being painted, and whether that was done: by the first view layer.
    save_to: str | None = None
    is_saved = False


def render(engine: Any, depsgraph: Any) -> None:
    """Renders a view layer into the result of an engine. Errors are shown by Blender, and nothing is written."""
    scene = depsgraph.scene
    layer = depsgraph.view_layer_eval
    frame = frame_of(scene.render)
    camera_object = engine.camera_override or scene.camera
    if camera_object is None or camera_object.type != "CAMERA":
        engine.report({"ERROR"}, "The scene has no camera. Add one, or choose one in the scene properties")
        return
    try:
        engine.update_stats("", "Reading the scene")
        with Clock(engine, depsgraph) as clock:
            export = _export(engine, depsgraph, camera_object, clock)
            views = _views(engine, depsgraph.scene)
            # As the camera was seen at other times.
            base = camera_matrix(engine, camera_object, depsgraph)
            cameras = {view: _camera(engine, camera_object, depsgraph, frame, export, base, view) for view in views}
            # They refer to the scene as it was evaluated.
            export.paths = None
        # Evaluation at other times has changed what Blender hands out.
        scene, layer = depsgraph.scene, depsgraph.view_layer_eval
        for camera, _ in cameras.values():
            _see_backdrop(camera, export, camera_object.name, layer)
        if scene.render.film_transparent and getattr(getattr(scene, "cycles", None), "film_transparent_glass", False):
            export.report.add("camera", scene.name, "Transparent Glass", Fidelity.APPROXIMATED, "behind glass alpha is 1")
        note_passes(layer, export.report)
        if not engine.is_preview:
            Kept.last_report = export.report
        for view, (camera, path) in cameras.items():
            export.scene.cameras["camera"] = camera
            if path:
                export.scene.cameras.set_motion("camera", path)
            if Kept.save_to is not None and not engine.is_preview:
                _save(scene, frame, export.scene)
                return
            _paint(engine, scene, layer, frame, export, Finish(export.reach), view)
            if engine.test_break():
                return
    except bottega.Error as error:
        # `error_set` would write a black picture.
        engine.report({"ERROR"}, f"Bottega: {error}")


def _save(scene: Any, frame: Frame, made: bottega.Scene) -> None:
    """Writes the scene to a file, unless another view layer has been written."""
    if Kept.is_saved or Kept.save_to is None:
        return
    settings = scene.bottega
    made.save(Kept.save_to, size=(frame.width, frame.height), spp=settings.samples, max_depth=settings.max_depth)
    Kept.is_saved = True


def _export(engine: Any, depsgraph: Any, camera: Any, clock: Clock) -> Export:
    """Returns the scene in memory; with Persistent Data only what has changed is read. Previews leave what is kept alone.

    Where the shutter is open for some time, the scene is then evaluated at the middle of it.
    """
    scene = depsgraph.scene
    if engine.is_preview:
        export = Export()
    elif not scene.render.use_persistent_data:
        Kept.exports.clear()
        export = Export()
    else:
        export = Kept.exports.setdefault(scene.name, Export())
        export.mark(depsgraph.updates)
    motion: Motion | None = None
    shutter = None if engine.is_preview else shutter_of(depsgraph.scene_eval, depsgraph.view_layer_eval, export.report)
    if shutter is not None:
        motion = follow(engine, depsgraph, camera, shutter, clock, export.mark)
    export.update(depsgraph, is_clear=depsgraph.scene.render.film_transparent, motion=motion)
    return export


def _see_backdrop(camera: bottega.Camera, export: Export, name: str, layer: Any) -> None:
    """Moves the far clip plane of a camera behind the backdrop, if there is one."""
    if export.reach is None:
        return
    if layer.use_pass_z or layer.use_pass_mist or layer.use_pass_normal:
        text = "where edges share a pixel with a world of the camera's own, the passes are those of the world"
        export.report.add("camera", name, "Passes", Fidelity.APPROXIMATED, text)
    if math.isinf(camera.far):
        return
    position = [row[3] for row in camera.transform[:3]]
    if camera.far < export.reach + math.hypot(*position):
        export.report.add("camera", name, "Clip End", Fidelity.APPROXIMATED, "nothing is clipped, because the camera sees a world of its own")
    camera.far = math.inf


def _views(engine: Any, scene: Any) -> list[str]:
    """Returns the names of the views that are rendered; one without a name if there is no stereoscopy."""
    if not scene.render.use_multiview or engine.is_preview:
        return [""]
    return [view.name for view in scene.render.views if view.use] or [""]


def _camera(
    engine: Any, camera: Any, depsgraph: Any, frame: Frame, export: Export, base: Any, view: str
) -> tuple[bottega.Camera, list[tuple[float, Any]]]:
    """Returns the camera of a view, and its path while the shutter is open; empty: it stands still.

    `base`: the matrix of the camera for all views.
    """
    export.report.begin("camera")
    evaluated = camera.evaluated_get(depsgraph)
    eye: Eye | None = None
    matrix = base
    if view:
        engine.active_view_set(view)
        side = view if view in ("left", "right") and evaluated.data.type == "PANO" and engine.use_spherical_stereo(evaluated) else None
        eye = Eye(engine.camera_shift_x(evaluated, use_spherical_stereo=side is not None), side)
        matrix = camera_matrix(engine, camera, depsgraph, side is not None)
    made = camera_of(evaluated, matrix, frame, export.report, eye)
    if export.paths is None:
        return made, []
    made.rolling_shutter = rolling_shutter_of(depsgraph.scene)
    path, lenses = export.paths.of_camera(evaluated, base)
    if any(lens != lens_of(evaluated) for lens in lenses):
        text = "the angle of the camera does not change while the shutter is open"
        export.report.add("camera", camera.name, "Motion Blur", Fidelity.LEFT_OUT, text)
    to_eye = np.linalg.inv(base) @ matrix if view else np.eye(4)
    return made, camera_keys([(time, matrix @ to_eye) for time, matrix in path])


def _paint(engine: Any, scene: Any, layer: Any, frame: Frame, export: Export, finish: Finish, view: str) -> None:
    """Renders a view in another thread; in this one shows what is painted, and watches for Escape."""
    crop = crop_of(scene.render, frame)
    made = export.scene
    fields = request_fields(scene, layer, frame, crop, finish, export.light_groups, export.shadow_catchers)
    if engine.is_preview:
        fields.pop("light_groups", None)
        fields.pop("shadow_catchers", None)
        fields.update(PREVIEW)
    engine.update_stats("", "Reading the scene")
    work = Work(made, fields) if engine.is_preview else work_for(scene.bottega, made, fields)
    try:
        _follow(engine, scene, layer, work, crop or (0, 0, frame.width, frame.height), finish, view)
    finally:
        work.end()


def _follow(engine: Any, scene: Any, layer: Any, work: Work, crop: tuple[int, int, int, int], finish: Finish, view: str) -> None:
    """Shows what is painted, hands the finished picture over, and ends at Escape with what is painted."""
    x0, y0, x1, y1 = crop
    # Blender places the result at the lower left corner of the region.
    result = engine.begin_result(0, 0, x1 - x0, y1 - y0, layer=layer.name, view=view)
    state: dict[str, Any] = {}

    def run() -> None:
        try:
            state["picture"] = work.render()
        except BaseException as error:
            state["error"] = error

    worker = threading.Thread(target=run, name="bottega", daemon=True)
    worker.start()
    said, next_show = "", time.monotonic() + SHOW_EVERY
    while worker.is_alive():
        worker.join(LOOK_EVERY)
        if engine.test_break():
            work.stop()
            worker.join()
        line = _line(work, (x1 - x0) * (y1 - y0))
        if line != said:
            said = line
            engine.update_progress(work.progress.fraction if work.progress is not None else 0.0)
            engine.update_stats("", line)
        if worker.is_alive() and not (bpy.app.background or engine.is_preview) and time.monotonic() > next_show:
            begun = time.monotonic()
            layers = work.layers()
            if layers is not None:
                _fill(result, None, layers, scene, finish)
                engine.update_result(result)
            now = time.monotonic()
            next_show = now + max(SHOW_EVERY, (now - begun) / SHOW_SHARE)
    for text in work.warnings:
        engine.report({"WARNING"}, text)
    error = state.get("error")
    if error is not None:
        engine.end_result(result, cancel=True)
        if isinstance(error, bottega.FarmError) and engine.test_break():
            # The picture was called off before there was one.
            return
        raise error
    _deliver(engine, result, scene, layer, state["picture"], finish)


def _line(work: Work, pixels: int) -> str:
    """Returns the line in the header of the picture."""
    parts = [work.state()]
    progress = work.progress
    if progress is not None:
        parts = [f"{100 * progress.fraction:.0f} %", f"{progress.done / max(pixels, 1):.0f} samples", f"{progress.seconds:.0f} s", *parts]
        if progress.seconds_left is not None:
            parts.append(f"{progress.seconds_left:.0f} s left")
    return " | ".join(part for part in parts if part)


def _deliver(engine: Any, result: Any, scene: Any, layer: Any, picture: Layers, finish: Finish) -> None:
    """Gives the finished picture to Blender."""
    engine.update_stats("", "Handing the passes over")
    for info in [None, *passes_of(scene, layer)]:
        _fill(result, info, picture, scene, finish)
    engine.end_result(result)


def _fill(result: Any, info: PassInfo | None, picture: Layers, scene: Any, finish: Finish) -> None:
    """Gives the pixels of a pass to Blender. `info`: `None` is Combined."""
    name = "Combined" if info is None else info.name
    target = next((one for one in result.layers[0].passes if one.name == name), None) if result.layers else None
    if target is None:
        return
    pixels = pixels_of(picture, info, scene, finish)
    if bpy.app.version >= (4, 0, 0):
        target.rect.foreach_set(pixels.ravel())
    else:
        # Early versions only take lists, one for each pixel.
        target.rect = pixels.tolist()
