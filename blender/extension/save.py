# SPDX-License-Identifier: GPL-3.0-or-later
"""File → Export → Bottega: the scene as a file that the program `bottega` and a farm read."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from . import library
from .engine import ENGINE


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
        from .render import Kept

        # The scene is exported by a render: only there Blender evaluates it as F12 does.
        render = context.scene.render
        kept = {name: getattr(render, name) for name in ("engine", "use_compositing", "use_sequencer")}
        Kept.save_to, Kept.is_saved = self.filepath, False
        try:
            render.engine, render.use_compositing, render.use_sequencer = ENGINE, False, False
            bpy.ops.render.render(scene=context.scene.name)
        except RuntimeError as error:
            self.report({"ERROR"}, str(error))
        finally:
            Kept.save_to = None
            for name, value in kept.items():
                setattr(render, name, value)
        return {"FINISHED"} if Kept.is_saved else {"CANCELLED"}


def _draw(self: Any, context: Any) -> None:
    self.layout.operator(BOTTEGA_OT_save_scene.bl_idname, text="Bottega (.bottega)")


def register() -> None:
    bpy.utils.register_class(BOTTEGA_OT_save_scene)
    bpy.types.TOPBAR_MT_file_export.append(_draw)


def unregister() -> None:
    bpy.types.TOPBAR_MT_file_export.remove(_draw)
    bpy.utils.unregister_class(BOTTEGA_OT_save_scene)
