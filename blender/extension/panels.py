# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of the render properties, and Blender's own panels that serve this engine as well."""

from __future__ import annotations

from typing import Any, Iterator

import bpy

from . import library
from .engine import ENGINE

# Blender's own panels for Eevee that show what Cycles' nodes, lights and worlds have.
_SHARED = {
    "EEVEE_MATERIAL_PT_context_material",
    "MATERIAL_PT_preview",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_MATERIAL_PT_volume",
    "EEVEE_MATERIAL_PT_displacement",
    "EEVEE_WORLD_PT_surface",
    "EEVEE_WORLD_PT_volume",
    "WORLD_PT_context_world",
    "DATA_PT_EEVEE_light",
    "DATA_PT_light",
    "DATA_PT_EEVEE_light_distance",
    "DATA_PT_spot",
    "EEVEE_NEXT_MATERIAL_PT_settings",
}
# Panels of other engines' settings.
_OTHERS = {"VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes", "RENDER_PT_simplify", "RENDER_PT_gpencil", "RENDER_PT_freestyle"}


def _serving() -> Iterator[Any]:
    """Yields Blender's panels that serve this engine too."""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if engines is None or panel.__name__ in _OTHERS:
            continue
        if "BLENDER_RENDER" in engines or panel.__name__ in _SHARED:
            yield panel


class _Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.engine == ENGINE


class BOTTEGA_PT_quality(_Panel, bpy.types.Panel):
    """The settings of a picture."""

    bl_label = "Quality"

    def draw(self, context: Any) -> None:
        layout, settings = self.layout, context.scene.bottega
        layout.use_property_split = True
        layout.use_property_decorate = False
        problem = library.problem()
        if problem is not None:
            layout.label(text=problem, icon="ERROR")
        layout.prop(settings, "goal", expand=True)
        if settings.goal == "ERROR":
            layout.prop(settings, "error", slider=True)
        if settings.goal == "TIME":
            layout.prop(settings, "seconds")
        else:
            layout.prop(settings, "samples")
        layout.prop(settings, "denoise")
        layout.prop(settings, "optimization")
        layout.separator()
        layout.prop(settings, "view_samples", text="Viewport")
        layout.prop(settings, "view_denoise", text="Denoise")


class BOTTEGA_PT_paths(_Panel, bpy.types.Panel):
    """How light is followed."""

    bl_label = "Light Paths"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layout, settings = self.layout, context.scene.bottega
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "max_depth")
        layout.prop(settings, "guide")
        layout.prop(settings, "seed")


class BOTTEGA_PT_film(_Panel, bpy.types.Panel):
    """The film."""

    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(context.scene.render, "film_transparent", text="Transparent")


class BOTTEGA_PT_machine(_Panel, bpy.types.Panel):
    """What the picture is made with."""

    bl_label = "This Machine"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(context.scene.bottega, "threads")
        layout.prop(context.scene.render, "use_persistent_data", text="Persistent Data")


class BOTTEGA_PT_report(_Panel, bpy.types.Panel):
    """What is not rendered as Cycles renders it."""

    bl_label = "Not as in Cycles"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layout = self.layout
        if library.problem() is not None:
            return
        from .render import Kept

        notes = Kept.last_report.all()
        layout.operator("bottega.bake", icon="RENDER_RESULT")
        if not notes:
            layout.label(text="Everything of the last picture was exact", icon="CHECKMARK")
        for note in notes[:40]:
            row = layout.column(align=True)
            icon = "ERROR" if note.fidelity.value == "left out" else "INFO"
            row.label(text=f"{note.owner}: {note.node}", icon=icon)
            row.label(text=f"{note.fidelity.value}: {note.text}", icon="BLANK1")
        if len(notes) > 40:
            layout.label(text=f"and {len(notes) - 40} more")


class BOTTEGA_PT_world_preview(_Panel, bpy.types.Panel):
    """A small picture of the world."""

    bl_label = "Preview"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and context.world is not None

    def draw(self, context: Any) -> None:
        self.layout.template_preview(context.world)


class BOTTEGA_PT_passes(_Panel, bpy.types.Panel):
    """The passes of a view layer."""

    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context: Any) -> None:
        layout, settings = self.layout, context.scene.bottega
        layer = context.view_layer
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(heading="Data")
        column.prop(layer, "use_pass_z", text="Depth")
        column.prop(layer, "use_pass_mist", text="Mist")
        column.prop(layer, "use_pass_normal", text="Normal")
        column.prop(settings, "use_albedo")
        column.prop(settings, "use_sample_count")
        column.prop(settings, "use_cost")
        column.prop(settings, "use_shadow_catcher")


class BOTTEGA_PT_light_groups(_Panel, bpy.types.Panel):
    """The light groups of a view layer: each is a pass of the light of its members."""

    bl_label = "Light Groups"
    bl_context = "view_layer"
    bl_parent_id = "BOTTEGA_PT_passes"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and hasattr(context.view_layer, "lightgroups")

    def draw(self, context: Any) -> None:
        layout, layer = self.layout, context.view_layer
        row = layout.row()
        row.column().template_list("UI_UL_list", "lightgroups", layer, "lightgroups", layer, "active_lightgroup_index", rows=3)
        column = row.column(align=True)
        column.operator("scene.view_layer_add_lightgroup", icon="ADD", text="")
        column.operator("scene.view_layer_remove_lightgroup", icon="REMOVE", text="")
        layout.operator("scene.view_layer_add_used_lightgroups", icon="ADD")
        layout.operator("scene.view_layer_remove_unused_lightgroups", icon="REMOVE")


class _LightGroupPanel(_Panel):
    bl_label = "Light Group"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and hasattr(cls.block(context), "lightgroup")

    @staticmethod
    def block(context: Any) -> Any:
        raise NotImplementedError

    def draw(self, context: Any) -> None:
        self.layout.use_property_split = True
        self.layout.prop_search(self.block(context), "lightgroup", context.view_layer, "lightgroups", text="Light Group")


class BOTTEGA_PT_object_light_group(_LightGroupPanel, bpy.types.Panel):
    """The light group of a lamp, or of an object that glows."""

    bl_context = "object"

    @staticmethod
    def block(context: Any) -> Any:
        return context.object


class BOTTEGA_PT_world_light_group(_LightGroupPanel, bpy.types.Panel):
    """The light group of the world."""

    bl_context = "world"

    @staticmethod
    def block(context: Any) -> Any:
        return context.world


class BOTTEGA_PT_object_shadow_catcher(_Panel, bpy.types.Panel):
    """Whether an object stands for one of a photographed plate."""

    bl_label = "Shadow Catcher"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and hasattr(context.object, "is_shadow_catcher")

    def draw(self, context: Any) -> None:
        self.layout.use_property_split = True
        self.layout.prop(context.object, "is_shadow_catcher")


_CLASSES = (
    BOTTEGA_PT_quality,
    BOTTEGA_PT_paths,
    BOTTEGA_PT_film,
    BOTTEGA_PT_machine,
    BOTTEGA_PT_report,
    BOTTEGA_PT_world_preview,
    BOTTEGA_PT_passes,
    BOTTEGA_PT_light_groups,
    BOTTEGA_PT_object_light_group,
    BOTTEGA_PT_world_light_group,
    BOTTEGA_PT_object_shadow_catcher,
)


def register() -> None:
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    for panel in _serving():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister() -> None:
    for panel in _serving():
        panel.COMPAT_ENGINES.discard(ENGINE)
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
