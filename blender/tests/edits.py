# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits in Blender: after each, the scene in memory renders to the bits of a fresh export. `edits.py [SEQUENCES]`."""

from __future__ import annotations

import random
import sys
from pathlib import Path
from typing import Any, Callable

sys.path.insert(0, str(Path(__file__).parent))

import bottega  # noqa: E402
import bpy  # noqa: E402
import numpy as np  # noqa: E402
import scenes  # noqa: E402
import support  # noqa: E402

STEPS = 5


def start() -> None:
    """Makes a scene with shared meshes, modifiers, instances, lights and a picture."""
    scenes.instances()
    scenes.ball((-1.0, 1.5, 0.5), 0.5, scenes.principled("Ball"))
    bpy.context.object.modifiers.new("Subdivision", "SUBSURF")
    scenes.add_light("POINT", (2, -2, 3), energy=100)
    textured, tree, output = scenes.nodes("Textured")
    shader, image, hue = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("BsdfDiffuse", "TexImage", "HueSaturation"))
    image.image = scenes.picture("Painted", 16, 8)
    hue.inputs["Hue"].default_value = 0.7
    tree.links.new(image.outputs["Color"], hue.inputs["Color"])
    tree.links.new(hue.outputs[0], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    bpy.data.objects["Floor"].data.materials[0] = textured
    # Materials that differ by the kind of ray and by the object
    two_sided = scenes.by_ray("By ray", "Is Camera Ray", "ShaderNodeBsdfDiffuse", "ShaderNodeEmission", second_Color=(0.1, 0.4, 0.8))
    tree = two_sided.node_tree
    info = tree.nodes.new("ShaderNodeObjectInfo")
    for output, node in (("Color", "Diffuse BSDF"), ("Random", "Emission")):
        tree.links.new(info.outputs[output], tree.nodes[node].inputs["Color"])
    for x in (-2.5, 2.5):
        scenes.cube((x, 1.0, 0.3), 0.5, two_sided)
    support.addon()


def meshes() -> list[Any]:
    return [item for item in bpy.context.scene.objects if item.type == "MESH"]


def move(dice: random.Random) -> None:
    dice.choice(list(bpy.context.scene.objects)).location.x += dice.uniform(-0.5, 0.5)


def hide(dice: random.Random) -> None:
    item = dice.choice(list(bpy.context.scene.objects))
    item.hide_viewport = not item.hide_viewport


def delete(dice: random.Random) -> None:
    items = [item for item in bpy.context.scene.objects if item.type in ("MESH", "LIGHT")]
    if items:
        bpy.data.objects.remove(dice.choice(items))


def rename(dice: random.Random) -> None:
    dice.choice(list(bpy.context.scene.objects)).name = f"Ünï {dice.random()}"


def recolor(dice: random.Random) -> None:
    materials = [material for material in bpy.data.materials if material.use_nodes]
    for node in dice.choice(materials).node_tree.nodes:
        socket = next((one for one in node.inputs if one.type == "RGBA"), None)
        if socket is not None:
            socket.default_value = (dice.random(), dice.random(), dice.random(), 1.0)


def change_slot(dice: random.Random) -> None:
    item = dice.choice(meshes() or [None])
    if item is not None and item.material_slots:
        item.material_slots[0].material = dice.choice([None, *bpy.data.materials])


def bend(dice: random.Random) -> None:
    item = dice.choice(meshes() or [None])
    if item is not None and len(item.data.vertices):
        item.data.vertices[dice.randrange(len(item.data.vertices))].co.z += dice.uniform(-0.2, 0.2)
        item.data.update()


def copy(dice: random.Random) -> None:
    item = dice.choice(meshes() or [None])
    if item is not None:
        other = item.copy()
        other.location.y += dice.uniform(0.2, 1.0)
        bpy.context.scene.collection.objects.link(other)


def relight(dice: random.Random) -> None:
    for light in bpy.data.lights:
        light.energy *= dice.uniform(0.5, 1.5)


def sky(dice: random.Random) -> None:
    background = bpy.context.scene.world.node_tree.nodes["Background"]
    background.inputs[0].default_value = (dice.random(), dice.random(), dice.random(), 1.0)


def modify(dice: random.Random) -> None:
    item = dice.choice(meshes() or [None])
    if item is None:
        return
    if item.modifiers:
        item.modifiers.clear()
    else:
        item.modifiers.new("Array", "ARRAY").count = 2


def flatten(dice: random.Random) -> None:
    item = dice.choice(meshes() or [None])
    if item is not None:
        item.scale.x = 0.0 if item.scale.x else 1.0


def retint(dice: random.Random) -> None:
    for item in meshes():
        item.color = (dice.random(), dice.random(), dice.random(), 1.0)


def background(dice: random.Random) -> None:
    """Lets the camera see another world than lights the scene, or the same again."""
    tree = bpy.context.scene.world.node_tree
    strength = tree.nodes["Background"].inputs["Strength"]
    if strength.links:
        tree.links.remove(strength.links[0])
    else:
        path = tree.nodes.new("ShaderNodeLightPath")
        tree.links.new(path.outputs["Is Camera Ray"], strength)


def repaint(dice: random.Random) -> None:
    image = dice.choice(list(bpy.data.images))
    image.pixels.foreach_set(np.random.default_rng(dice.randrange(1000)).random(len(image.pixels), np.float32))
    # Blender reports what a user paints or loads; a script must report it itself.
    image.update_tag()


EDITS: list[Callable[[random.Random], None]] = [
    move, hide, delete, rename, recolor, change_slot, bend, copy, relight, sky, modify, flatten, repaint, retint, background,
]


def bits(export: Any) -> bytes:
    scene = export.scene
    scene.cameras["camera"] = bottega.Camera.looking((0, 3, 7), (0, 0, 0))
    picture = bottega.render(scene, camera="camera", spp=1, size=(24, 16), max_depth=3, guide={"by": "none"}, threads=2)
    return np.ascontiguousarray(picture.color).tobytes()


def main() -> None:
    count = int((support.arguments() or ["100"])[0])
    support.addon()
    Export = support.part("export").Export
    for seed in range(count):
        dice = random.Random(seed)
        start()
        export = Export()

        def mark(scene: Any, depsgraph: Any) -> None:
            export.mark(depsgraph.updates)

        bpy.app.handlers.depsgraph_update_post.append(mark)
        export.update(bpy.context.evaluated_depsgraph_get())
        bits(export)
        done = []
        for _ in range(STEPS):
            edit = dice.choice(EDITS)
            done.append(edit.__name__)
            edit(dice)
            bpy.context.view_layer.update()
            depsgraph = bpy.context.evaluated_depsgraph_get()
            export.update(depsgraph)
            fresh = Export()
            fresh.update(depsgraph)
            if bits(export) != bits(fresh):
                support.failed(f"seed {seed}: other bits after {', '.join(done)}")
        bpy.app.handlers.depsgraph_update_post.remove(mark)
        if seed % 10 == 9:
            print(f"EDITS {seed + 1} sequences", flush=True)
    support.leave()


main()
