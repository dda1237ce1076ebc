# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine: final pictures, and the viewport."""

from __future__ import annotations

import traceback
from typing import Any

import bpy

from . import library

ENGINE = "BOTTEGA"


class BottegaEngine(bpy.types.RenderEngine):
    """Bottega, as Blender calls it."""

    bl_idname = ENGINE
    bl_label = "Bottega"
    bl_use_preview = True
    bl_use_postprocess = True
    bl_use_shading_nodes_custom = False
    bl_use_eevee_viewport = True

    def render(self, depsgraph: Any) -> None:
        """Renders a view layer. Blender calls it in a thread of its own."""
        problem = library.problem()
        if problem is not None:
            self.report({"ERROR"}, problem)
            return
        from .render import render

        try:
            render(self, depsgraph)
        except Exception as error:
            # Blender would write a black picture and say that it is finished.
            traceback.print_exc()
            self.report({"ERROR"}, f"Bottega: {type(error).__name__}: {error}")

    def update_render_passes(self, scene: Any = None, renderlayer: Any = None) -> None:
        """Declares the passes of a view layer."""
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        if library.problem() is None:
            from .final import passes_of

            for info in passes_of(scene, renderlayer):
                self.register_pass(scene, renderlayer, info.name, info.channels, info.letters, info.kind)

    def view_update(self, context: Any, depsgraph: Any) -> None:
        """Takes over what has changed in the scene."""
        view = self._view()
        if view is not None:
            view.update(context, depsgraph)

    def view_draw(self, context: Any, depsgraph: Any) -> None:
        """Draws the view: after it has turned, and when a frame has become finer."""
        view = self._view()
        if view is not None:
            view.draw(context, depsgraph)

    def _view(self) -> Any:
        """Returns what this engine shows in its 3D view; `None`: the renderer cannot be loaded."""
        problem = library.problem()
        if problem is not None:
            self.update_stats("", problem)
            return None
        view = self.__dict__.get("held_view")
        if view is None:
            from .view import View

            view = self.__dict__["held_view"] = View(self)
        return view

    def __del__(self) -> None:
        view = self.__dict__.pop("held_view", None)
        if view is not None:
            view.end()


@bpy.app.handlers.persistent
def _forget(*_: Any) -> None:
    """Forgets what was exported of the file that was open before."""
    if library.problem() is None:
        from .render import Kept

        Kept.exports.clear()


def register() -> None:
    bpy.utils.register_class(BottegaEngine)
    bpy.app.handlers.load_post.append(_forget)


def unregister() -> None:
    bpy.app.handlers.load_post.remove(_forget)
    if library.problem() is None:
        from .view import View

        View.end_all()
    bpy.utils.unregister_class(BottegaEngine)
