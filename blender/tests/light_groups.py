# SPDX-License-Identifier: GPL-3.0-or-later
"""Light groups beside Cycles of the same Blender: `light_groups.py FOLDER`.

Prints the ratio of the means of each group's pass, and FLIP.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import bottega  # noqa: E402
import bpy  # noqa: E402
import support  # noqa: E402

SIZE, SAMPLES = (160, 120), 256
GROUPS = ("Key light", "glow", "sky", "nobody")


def glowing(name: str, strength: float, place: tuple[float, float, float]) -> Any:
    """Adds a ball that glows."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3, location=place)
    ball = bpy.context.object
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    emission.inputs["Color"].default_value, emission.inputs["Strength"].default_value = (1.0, 0.6, 0.2, 1.0), strength
    material.node_tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    ball.data.materials.append(material)
    return ball


def matte() -> Any:
    """Returns a material that both engines compute alike."""
    material = bpy.data.materials.new("matte")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    diffuse, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    return material


def add_light(kind: str, place: tuple[float, float, float], energy: float) -> Any:
    data = bpy.data.lights.new(kind.lower(), kind)
    data.energy = energy
    item = bpy.data.objects.new(kind.lower(), data)
    item.location = place
    bpy.context.collection.objects.link(item)
    return item


def build() -> None:
    """A cube on a floor with two lamps, a ball that glows, and a world: one lamp is in no group."""
    bpy.ops.wm.read_factory_settings(use_empty=False)
    scene = bpy.context.scene
    support.addon()
    for item in [item for item in scene.objects if item.type == "LIGHT"]:
        bpy.data.objects.remove(item)
    bpy.ops.mesh.primitive_plane_add(size=12.0, location=(0.0, 0.0, -1.0))
    bpy.context.object.data.materials.append(matte())
    layer = scene.view_layers[0]
    for name in GROUPS:
        layer.lightgroups.add(name=name)
    add_light("AREA", (3.0, -2.0, 4.0), 300.0).lightgroup = "Key light"
    add_light("POINT", (-3.0, -3.0, 3.0), 200.0)
    glowing("Glow", 12.0, (2.0, 1.5, -0.5)).lightgroup = "glow"
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.2, 0.4, 0.9, 1.0)
    scene.world.lightgroup = "sky"


def main() -> None:
    folder = Path(support.arguments()[0])
    support.addon()
    if "lightgroups" not in bpy.types.ViewLayer.bl_rna.properties:
        print("SKIPPED: this Blender has no light groups", flush=True)
        support.leave()
    build()
    support.settle(bpy.context.scene, *SIZE, SAMPLES)
    ours, theirs = (support.layers_of(engine, folder / f"groups-{engine.lower()}.exr", SAMPLES) for engine in ("BOTTEGA", "CYCLES"))
    for name in GROUPS:
        one, other = (found[f"Combined_{name}"][..., :3] for found in (ours, theirs))
        if name == "nobody":
            if one.any() or other.any():
                support.failed("the group without lights is not black")
            continue
        ratios = one.mean((0, 1)) / other.mean((0, 1)).clip(1e-6)
        flip = bottega.diff(one.copy(), other.copy())["flip"]
        print(f"GROUP {name:10} mean {' '.join(f'{ratio:.4f}' for ratio in ratios)}  FLIP {flip:.4f}", flush=True)
        # Cycles' picture of a small ball that glows is noisy.
        if abs(ratios - 1.0).max() > 0.02 or (flip > 0.05 and name != "glow"):
            support.failed(f"the light of {name} is another one")
    support.leave()


if __name__ == "__main__":
    main()
