# SPDX-License-Identifier: GPL-3.0-or-later
"""File → Export → Bottega: the scene as a file that the program `bottega` and a farm read."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from . import library


class BOTTEGA_OT_save_scene(bpy.types.Operator, ExportHelper):
    """Write the scene, as F12 renders it, to a file for `bottega render`"""

    bl_idname = "bottega.save_scene"
    bl_label = "Export Bottega"
    filename_ext = ".bottega"
    filter_glob: StringProperty(default="*.bottega", options={"HIDDEN"})

    def execute(self, context: Any) -> set[str]:
        problem = library.problem()
        if problem is not None:
            self.report({"ERROR"}, problem)
            return {"CANCELLED"}
        import bottega

        from .export import Export
        from .export.camera import camera_of, frame_of, is_mirrored

        scene, depsgraph = context.scene, context.evaluated_depsgraph_get()
        if scene.camera is None or scene.camera.type != "CAMERA":
            self.report({"ERROR"}, "The scene has no camera. Add one, or choose one in the scene properties")
            return {"CANCELLED"}
        export, frame = Export(), frame_of(scene.render)
        try:
            export.update(depsgraph)
            camera = scene.camera.evaluated_get(depsgraph)
            made = camera_of(camera, camera.matrix_world, frame, export.report)
            made.hides_emitters = scene.render.film_transparent
            if is_mirrored(made):
                self.report({"WARNING"}, "The camera mirrors, so the picture of the file has its columns reversed")
            export.scene.cameras["camera"] = made
            settings = scene.bottega
            size = (frame.width, frame.height)
            export.scene.save(self.filepath, size=size, spp=settings.samples, max_depth=settings.max_depth)
        except (bottega.Error, OSError) as error:
            self.report({"ERROR"}, f"Bottega: {error}")
            return {"CANCELLED"}
        return {"FINISHED"}


def _draw(self: Any, context: Any) -> None:
    self.layout.operator(BOTTEGA_OT_save_scene.bl_idname, text="Bottega (.bottega)")


def register() -> None:
    bpy.utils.register_class(BOTTEGA_OT_save_scene)
    bpy.types.TOPBAR_MT_file_export.append(_draw)


def unregister() -> None:
    bpy.types.TOPBAR_MT_file_export.remove(_draw)
    bpy.utils.unregister_class(BOTTEGA_OT_save_scene)
