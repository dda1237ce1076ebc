# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of motion blur, with the settings of Blender and Cycles."""

from __future__ import annotations

from typing import Any

import bpy

from .engine import ENGINE

# Kinds of objects that Cycles' settings of motion blur are for, and lights.
_MOVING = {"MESH", "CURVE", "SURFACE", "FONT", "META", "CAMERA", "CURVES", "LIGHT"}


class _Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_label = "Motion Blur"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.engine == ENGINE


class BOTTEGA_PT_motion(_Panel, bpy.types.Panel):
    """The shutter of a scene."""

    def draw_header(self, context: Any) -> None:
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context: Any) -> None:
        layout, scene = self.layout, context.scene
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.active = scene.render.use_motion_blur
        # Before 4.2 the position is a setting of Cycles.
        owner = scene.render if hasattr(scene.render, "motion_blur_position") else getattr(scene, "cycles", None)
        if owner is not None:
            layout.prop(owner, "motion_blur_position", text="Position")
        layout.prop(scene.render, "motion_blur_shutter")
        if hasattr(context.view_layer, "use_motion_blur"):
            layout.prop(context.view_layer, "use_motion_blur", text="In This View Layer")


class BOTTEGA_PT_motion_curve(_Panel, bpy.types.Panel):
    """How the shutter opens and closes."""

    bl_label = "Shutter Curve"
    bl_parent_id = "BOTTEGA_PT_motion"

    def draw(self, context: Any) -> None:
        render = context.scene.render
        self.layout.active = render.use_motion_blur
        self.layout.template_curve_mapping(render, "motion_blur_shutter_curve")


class BOTTEGA_PT_object_motion(_Panel, bpy.types.Panel):
    """How an object moves while the shutter is open."""

    bl_context = "object"

    @classmethod
    def poll(cls, context: Any) -> bool:
        item = context.object
        if not super().poll(context) or item is None or not hasattr(item, "cycles"):
            return False
        return item.type in _MOVING or (item.instance_type == "COLLECTION" and item.instance_collection is not None)

    def draw_header(self, context: Any) -> None:
        self.layout.active = context.scene.render.use_motion_blur
        self.layout.prop(context.object.cycles, "use_motion_blur", text="")

    def draw(self, context: Any) -> None:
        layout, item = self.layout, context.object
        layout.use_property_split = True
        layout.active = context.scene.render.use_motion_blur and item.cycles.use_motion_blur
        layout.prop(item.cycles, "motion_steps", text="Steps")
        if item.type not in ("CAMERA", "LIGHT"):
            layout.prop(item.cycles, "use_deform_motion", text="Deformation")


_CLASSES = (BOTTEGA_PT_motion, BOTTEGA_PT_motion_curve, BOTTEGA_PT_object_motion)


def register() -> None:
    for cls in _CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
