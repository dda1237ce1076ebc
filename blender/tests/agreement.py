# SPDX-License-Identifier: GPL-3.0-or-later
"""Agreement with Cycles of the same Blender: `agreement.py FOLDER [SCENE …]`.

Each scene of `scenes.py` is rendered by both. Prints the ratio of the means, FLIP, and the bars that the manual gives for the scene.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import bottega  # noqa: E402
import scenes  # noqa: E402
import support  # noqa: E402

# The greatest difference of the means, and FLIP, by scene; those that are not here have 1 % and 0.05.
USUAL = (0.01, 0.05)
BARS: dict[str, tuple[float, float]] = {
    # A plane of Principled below a lamp: what lies below Cycles' reflection is dimmed by the direction of the view alone, ours by both.
    "textures": (0.02, 0.05),
    "bare": (0.02, 0.05),
    # Light that grazes reliefs is dimmed by other formulas.
    "reliefs": (0.02, 0.05),
    # Cycles' substances reflect up to 3 % more than the base color.
    "subsurface": (0.03, 0.09),
    # Cycles 5 takes the temperature of one voxel nearby by chance, whose mean is another radiance; 4.2 looks half a voxel aside.
    "fire": (0.035, 0.1),
    # Reflections by the angle to the facets instead of the surface.
    "coats": (0.02, 0.05),
}
SIZE, SAMPLES = (192, 128), 128
# Scenes that are not compared with Cycles' motion blur, but with the mean of its pictures of so many moments.
BY_MOMENTS, MOMENT_SAMPLES = {"moving_lamps": 32}, 12


def by_moments(file: Path, count: int) -> Any:
    """Returns the mean of Cycles' pictures of moments while the shutter is open: from half a frame before to half a frame after."""
    import bpy

    scene = bpy.context.scene
    scene.render.use_motion_blur = False
    frame, total = scene.frame_current, 0.0
    for index in range(count):
        time = frame - 0.5 + (index + 0.5) / count
        scene.frame_set(math.floor(time), subframe=time % 1.0)
        total = total + support.picture_of("CYCLES", file, MOMENT_SAMPLES) / count
    return total


def main() -> None:
    folder, *names = support.arguments()
    wrong = []
    for name in names or list(scenes.SCENES):
        support.addon()
        scenes.SCENES[name]()
        support.addon()
        import bpy

        support.settle(bpy.context.scene, *SIZE, SAMPLES)
        files = [Path(folder) / f"{name}-{engine.lower()}.exr" for engine in ("BOTTEGA", "CYCLES")]
        ours = support.picture_of("BOTTEGA", files[0], SAMPLES)
        moments = BY_MOMENTS.get(name)
        theirs = support.picture_of("CYCLES", files[1], SAMPLES) if moments is None else by_moments(files[1], moments)
        difference = bottega.diff(ours, theirs)
        ratios = ours.mean((0, 1)) / theirs.mean((0, 1)).clip(1e-6)
        # Principled's matte part was another one before 4.0.
        mean, flip = (0.05, 0.08) if bpy.app.version < (4, 0, 0) else BARS.get(name, USUAL)
        alphas = [bottega.read(file)["alpha"] for file in files] if bpy.context.scene.render.film_transparent else []
        if alphas:
            apart = float(abs(alphas[0] - alphas[1]).mean())
            print(f"AGREEMENT {name:16} alpha differs by {apart:.4f} in the mean", flush=True)
            mean = mean if apart <= 0.01 else -1.0
        is_good = abs(ratios - 1).max() <= mean and difference["flip"] <= flip
        verdict = "" if is_good else "  TOO FAR"
        print(f"AGREEMENT {name:16} mean {' '.join(f'{ratio:.4f}' for ratio in ratios)}  FLIP {difference['flip']:.4f}{verdict}", flush=True)
        for note in support.part("render").Kept.last_report.all():
            print(f"    {note.fidelity.value}: {note.owner}, {note.node}: {note.text}")
        if not is_good:
            wrong.append(name)
    if wrong:
        support.failed(f"too far from Cycles: {', '.join(wrong)}")
    support.leave()


main()
