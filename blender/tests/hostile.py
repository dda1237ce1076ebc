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


@case(True)
def many_values() -> None:
    """More objects with values of their own than there are materials for them."""
    scenes.empty((0.5, 0.5, 0.5))
    material, tree, output = scenes.nodes("Random")
    info, emission = tree.nodes.new("ShaderNodeObjectInfo"), tree.nodes.new("ShaderNodeEmission")
    tree.links.new(info.outputs["Random"], emission.inputs["Strength"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    part = scenes.cube((0, 0, 0), 0.1, material)
    for index in range(400):
        scenes.link(f"Cube {index}", part.data, (0.2 * (index % 20) - 2.0, 0.2 * (index // 20) - 1.0, 0.1))


@case(True)
def nobody_has_it() -> None:
    """Values of objects in a world and a light, unknown properties, and Light Path wherever it may be."""
    scenes.factory()
    trees = [bpy.data.materials["Material"].node_tree, bpy.context.scene.world.node_tree, bpy.data.lights["Light"].node_tree]
    if trees[2] is None:
        bpy.data.lights["Light"].use_nodes = True
        trees[2] = bpy.data.lights["Light"].node_tree
    for tree in trees:
        shader = next(node for node in tree.nodes if any(socket.name == "Strength" or socket.name == "Alpha" for socket in node.inputs))
        path, info, attribute = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("LightPath", "ObjectInfo", "Attribute"))
        attribute.attribute_type, attribute.attribute_name = "OBJECT", '"]. nothing\\'
        total = info.outputs["Random"]
        for output in (*path.outputs, attribute.outputs["Fac"]):
            add = tree.nodes.new("ShaderNodeMath")
            tree.links.new(total, add.inputs[0])
            tree.links.new(output, add.inputs[1])
            total = add.outputs[0]
        tree.links.new(total, next(socket for socket in shader.inputs if socket.name in ("Strength", "Alpha")))


@case(True)
def broken_motion() -> None:
    """Motion blur of what mirrors, becomes flat or hidden, has another number of vertices or is nowhere on its way, and of hair."""
    made = scenes.empty((0.5, 0.5, 0.5))
    for index, scale in enumerate(((-1, 1, 1), (0, 1, 1), (1e30, 1, 1))):
        scenes.moved(scenes.cube((index - 1.0, 0, 0), 0.5), "scale", (1, 1, 1), scale)
    array = scenes.cube((0, 1, 0), 0.4).modifiers.new("Array", "ARRAY")
    scenes.moved(array, "count", 1, 4)
    nowhere = scenes.cube((0, 0, 1), 0.5)
    scenes.moved(nowhere, "location", (0, 0, 1), (math.inf, 0, 0))
    scenes.moved(nowhere, "hide_render", False, True)
    lamp = scenes.add_light("AREA", (0, 0, 3), energy=100)
    scenes.moved(lamp, "scale", (1, 1, 1), (0, 1, 1))
    scenes.add_light("SPOT", (1, 0, 3), energy=100).parent = lamp
    emitter = scenes.ball((1, 0, 0), 0.3)
    bend = emitter.modifiers.new("Bend", "SIMPLE_DEFORM")
    bend.deform_method = "BEND"
    scenes.moved(bend, "angle", 0.0, 1.0)
    emitter.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.type, settings.count = "HAIR", 20
    scenes.moved(made.camera.data, "lens", 20.0, 60.0)
    for point in made.render.motion_blur_shutter_curve.curves[0].points:
        point.location.y = 0.0
    made.cycles.rolling_shutter_type = "TOP"
    scenes.blurred(made)


def preview() -> None:
    """Renders the preview of a material, as the panel of materials shows it, and looks at its color."""
    scenes.factory()
    support.addon()
    bpy.context.scene.render.engine = "BOTTEGA"
    material = scenes.principled("Red", Base_Color=(0.8, 0.02, 0.02))
    bpy.data.objects["Cube"].data.materials[0] = material
    before = support.part("render").Kept.last_report
    material.asset_generate_preview()
    shown = material.preview
    width, height = shown.image_size if shown is not None else (0, 0)
    pixels = list(shown.image_pixels_float) if width else []
    middle = pixels[4 * (width * (height // 2) + width // 2) :][:4]
    print(f"HOSTILE preview: {width} x {height}, {middle}", flush=True)
    if not middle or middle[0] < 2.0 * middle[1] or support.part("render").Kept.last_report is not before:
        support.failed("the preview of a material is not of its color")


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
            painted, problem = True, ""
        except Exception as error:
            painted, problem = False, str(error)
        notes = support.part("render").Kept.last_report.all()
        print(f"HOSTILE {name}: {'painted' if painted else problem.strip()}; {'; '.join(note.text for note in notes)}", flush=True)
        if painted != is_painted:
            wrong.append(name)
    preview()
    if wrong:
        support.failed(", ".join(wrong))
    support.leave()


main()
