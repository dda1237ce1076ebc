# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes that are broken in some way render, or say why not; Blender stays alive. `hostile.py FOLDER`."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Callable

sys.path.insert(0, str(Path(__file__).parent))

import bpy  # noqa: E402
import scenes  # noqa: E402
import support  # noqa: E402

CASES: list[tuple[str, Callable[[], None], bool]] = []


def case(is_painted: bool) -> Callable[[Callable[[], None]], Callable[[], None]]:
    """Registers a case. `is_painted`: a picture is made; otherwise an error is shown."""

    def register(function: Callable[[], None]) -> Callable[[], None]:
        CASES.append((function.__name__, function, is_painted))
        return function

    return register


@case(True)
def empty_scene() -> None:
    scenes.empty()


@case(False)
def no_camera() -> None:
    scenes.empty()
    bpy.data.objects.remove(bpy.context.scene.camera)


@case(True)
def missing_picture() -> None:
    scenes.textured_room()
    for image in bpy.data.images:
        if image.packed_file:
            image.unpack(method="REMOVE")
            image.filepath = "/nowhere/Ünï中.png"
            image.reload()


@case(True)
def cyclic_groups() -> None:
    scenes.groups()
    material = bpy.data.materials["Grouped"]
    tree = material.node_tree
    a, b = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(a.outputs[0], b.inputs[1])
    tree.links.new(b.outputs[0], a.inputs[1])
    tree.links.new(b.outputs[0], tree.nodes["Material Output"].inputs["Surface"])


@case(True)
def two_outputs() -> None:
    scenes.factory()
    tree = bpy.data.materials["Material"].node_tree
    tree.nodes.new("ShaderNodeOutputMaterial")
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeOutputMaterial":
            node.is_active_output = True


@case(True)
def scale_zero() -> None:
    scenes.factory()
    bpy.data.objects["Cube"].scale = (0.0, 1.0, 1.0)


@case(True)
def nan_vertices() -> None:
    scenes.factory()
    bpy.data.objects["Cube"].data.vertices[0].co = (math.nan, math.inf, 0.0)


@case(True)
def faces_without_area() -> None:
    scenes.factory()
    for vertex in bpy.data.objects["Cube"].data.vertices:
        vertex.co.z = 0.0
        vertex.co.x = 0.0


@case(True)
def mesh_without_faces() -> None:
    scenes.factory()
    mesh = bpy.data.meshes.new("Points")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0)], [(0, 1)], [])
    scenes.link("Points", mesh)


@case(True)
def nan_pixels() -> None:
    scenes.textured_room()
    image = scenes.picture("Broken", 8, 8, is_float=True)
    pixels = list(image.pixels)
    pixels[0], pixels[5] = math.nan, math.inf
    image.pixels = pixels
    node = next(node for node in bpy.data.materials["Picture"].node_tree.nodes if node.type == "TEX_IMAGE")
    node.image = image


@case(True)
def names() -> None:
    scenes.factory()
    for block in (*bpy.data.objects, *bpy.data.materials, *bpy.data.meshes, bpy.context.scene, bpy.context.scene.world):
        block.name = "Ünï中 / \\ \" ' \n %s"


@case(True)
def hidden_collections() -> None:
    scenes.factory()
    hidden = bpy.data.collections.new("Hidden")
    bpy.context.scene.collection.children.link(hidden)
    hidden.objects.link(bpy.data.objects.new("Hidden cube", bpy.data.objects["Cube"].data))
    hidden.hide_render = True
    excluded = bpy.data.collections.new("Excluded")
    bpy.context.scene.collection.children.link(excluded)
    excluded.objects.link(bpy.data.objects.new("Excluded cube", bpy.data.objects["Cube"].data))
    bpy.context.view_layer.layer_collection.children["Excluded"].exclude = True


@case(True)
def no_material_output() -> None:
    scenes.factory()
    bpy.data.materials["Material"].node_tree.nodes.clear()


@case(True)
def no_world() -> None:
    scenes.factory()
    bpy.context.scene.world = None


def main() -> None:
    folder = Path(support.arguments()[0])
    wrong = []
    for name, make, is_painted in CASES:
        support.addon()
        make()
        support.addon()
        support.settle(bpy.context.scene, 48, 32, 4)
        file = folder / f"hostile-{name}.exr"
        file.unlink(missing_ok=True)
        try:
            support.picture_of("BOTTEGA", file, 4)
            painted, told = True, ""
        except Exception as error:
            painted, told = False, str(error)
        notes = support.part("render").Kept.last_report.all()
        print(f"HOSTILE {name}: {'painted' if painted else told.strip()}; {'; '.join(note.text for note in notes)}", flush=True)
        if painted != is_painted:
            wrong.append(name)
    if wrong:
        support.failed(", ".join(wrong))
    support.leave()


main()
