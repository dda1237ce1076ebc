# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow catchers beside Cycles of the same Blender: `shadow_catchers.py FOLDER`.

Prints means of alpha and of the pass *Shadow Catcher* of both, and FLIP of the pictures.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import bottega  # noqa: E402
import bpy  # noqa: E402
import numpy as np  # noqa: E402
import support  # noqa: E402
from light_groups import add_light, matte  # noqa: E402

SIZE, SAMPLES = (160, 120), 256


def build() -> None:
    """A cube on a floor that catches its shadows, under a lamp and a world."""
    bpy.ops.wm.read_factory_settings(use_empty=False)
    scene = bpy.context.scene
    support.addon()
    for item in [item for item in scene.objects if item.type == "LIGHT"]:
        bpy.data.objects.remove(item)
    bpy.context.scene.objects["Cube"].data.materials.clear()
    bpy.context.scene.objects["Cube"].data.materials.append(matte())
    bpy.ops.mesh.primitive_plane_add(size=12.0, location=(0.0, 0.0, -1.0))
    floor = bpy.context.object
    floor.data.materials.append(matte())
    floor.is_shadow_catcher = True
    add_light("AREA", (3.0, -2.0, 4.0), 300.0)
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.2, 0.4, 0.9, 1.0)
    scene.render.film_transparent = True


def rendered(engine: str, file: Path, has_pass: bool) -> dict[str, Any]:
    """Renders by an engine. Returns the layers of the file.

    - `has_pass`: shadows are in the pass instead of alpha.
    """
    scene = bpy.context.scene
    scene.bottega.use_shadow_catcher = has_pass
    scene.view_layers[0].cycles.use_pass_shadow_catcher = has_pass
    return support.layers_of(engine, file, SAMPLES, has_pass)


def compare(name: str, ours: Any, theirs: Any) -> None:
    """Compares a layer of both engines. Faint noise of alpha is more to FLIP than to the eye, so the mean difference counts there."""
    one, other = (np.ascontiguousarray(layer if layer.ndim == 3 else np.repeat(layer[..., None], 3, -1)) for layer in (ours, theirs))
    ratios = one.mean((0, 1)) / other.mean((0, 1)).clip(1e-6)
    flip = bottega.diff(one, other)["flip"]
    difference = float(np.abs(one - other).mean())
    print(f"CATCHER {name:14} mean {' '.join(f'{ratio:.4f}' for ratio in ratios)}  FLIP {flip:.4f}  MAE {difference:.4f}", flush=True)
    if abs(ratios - 1.0).max() > 0.02 or (flip > 0.05 if name != "alpha" else difference > 0.01):
        support.failed(f"{name} is another one")


def main() -> None:
    folder = Path(support.arguments()[0])
    support.addon()
    if "is_shadow_catcher" not in bpy.types.Object.bl_rna.properties:
        print("SKIPPED: this Blender keeps shadow catchers among the settings of Cycles", flush=True)
        support.leave()
    build()
    support.settle(bpy.context.scene, *SIZE, SAMPLES)
    for has_pass, names in ((True, ("Combined", "Shadow Catcher")), (False, ("color", "alpha"))):
        ours, theirs = (
            rendered(engine, folder / f"catchers-{engine.lower()}-{has_pass}.exr", has_pass) for engine in ("BOTTEGA", "CYCLES")
        )
        for name in names:
            compare(name, ours[name], theirs[name])
    support.leave()


if __name__ == "__main__":
    main()
