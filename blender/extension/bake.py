# SPDX-License-Identifier: GPL-3.0-or-later
"""Baking: what the renderer does not know, such as procedural textures, becomes pictures by Cycles.

A picture is kept, packed, with the material; it is used as long as the nodes are those that were baked.
"""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import IntProperty

from . import bake_world, library


def wanted(materials: list[Any]) -> list[tuple[Any, Any]]:
    """Returns materials with inputs whose values are unknown to the renderer."""
    from .export.materials import MaterialMaker
    from .export.report import Report
    from .export.textures import Pictures

    found = []
    for material in materials:
        maker = MaterialMaker(Pictures(), Report(), "", material.name)
        maker.make(material)
        found += [(material, socket) for socket in maker.reader.bakeable]
    return found


def bearer(material: Any) -> Any:
    """Returns a mesh object with a material and texture coordinates; `None`: there is none."""
    for item in bpy.context.view_layer.objects:
        has = item.type == "MESH" and item.data.uv_layers and item.visible_get()
        if has and any(slot.material == material for slot in item.material_slots):
            return item
    return None


def bake(material: Any, socket: Any, size: int) -> bool:
    """Bakes what feeds an input to a picture. Returns false if no object with texture coordinates has the material."""
    from .export.baked import PROPERTY, name_of

    item = bearer(material)
    if item is None:
        return False
    name = name_of(socket)
    image = bpy.data.images.new(f"{material.name} {socket.name} baked", size, size, float_buffer=True)
    tree = material.node_tree
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    surface = output.inputs["Surface"]
    before = surface.links[0].from_socket if surface.links else None
    target, emission = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeEmission")
    try:
        target.image = image
        tree.links.new(socket.links[0].from_socket, emission.inputs["Color"])
        tree.links.new(emission.outputs[0], surface)
        tree.nodes.active = target
        _bake_active(item)
    finally:
        if before is not None:
            tree.links.new(before, surface)
        tree.nodes.remove(target)
        tree.nodes.remove(emission)
    image.pack()
    kept = dict(material.get(PROPERTY, {}))
    kept[name] = image.name
    material[PROPERTY] = kept
    return True


def _bake_active(item: Any) -> None:
    """Bakes what an object emits to the active picture of its materials."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    engine, samples = scene.render.engine, scene.cycles.samples
    selected, active = [one for one in layer.objects if one.select_get()], layer.objects.active
    try:
        scene.render.engine, scene.cycles.samples = "CYCLES", 4
        for one in selected:
            one.select_set(False)
        item.select_set(True)
        layer.objects.active = item
        bpy.ops.object.bake(type="EMIT", margin=8, use_clear=True)
    finally:
        scene.render.engine, scene.cycles.samples = engine, samples
        item.select_set(False)
        for one in selected:
            one.select_set(True)
        layer.objects.active = active


class BOTTEGA_OT_bake(bpy.types.Operator):
    """Let Cycles make pictures of procedural textures and other nodes that the renderer does not know"""

    bl_idname = "bottega.bake"
    bl_label = "Bake Unknown Nodes"
    bl_options = {"REGISTER", "UNDO"}

    size: IntProperty(name="Size", description="Width and height of each picture", default=1024, min=16, max=16384)

    def execute(self, context: Any) -> set[str]:
        if library.problem() is not None:
            self.report({"ERROR"}, library.problem())
            return {"CANCELLED"}
        used = {slot.material for item in context.scene.objects for slot in item.material_slots if slot.material}
        done, left = 0, []
        for material, socket in wanted(sorted(used, key=lambda material: material.name)):
            if bake(material, socket, self.size):
                done += 1
            else:
                left.append(material.name)
        if bake_world.is_wanted(context.scene.world):
            bake_world.bake_world(context.scene.world, 2 * self.size)
            done += 1
        self.report({"INFO"}, f"{done} pictures were baked")
        if left:
            self.report({"WARNING"}, f"No object with texture coordinates has the material: {', '.join(left)}")
        return {"FINISHED"}


def register() -> None:
    bpy.utils.register_class(BOTTEGA_OT_bake)


def unregister() -> None:
    bpy.utils.unregister_class(BOTTEGA_OT_bake)
