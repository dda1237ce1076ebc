# SPDX-License-Identifier: GPL-3.0-or-later
"""Procedural textures are baked by Cycles, and rendered as Cycles renders them: `bake.py FOLDER`."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bottega  # noqa: E402
import bpy  # noqa: E402
import scenes  # noqa: E402
import support  # noqa: E402


def sky(folder: Path) -> None:
    """A sky is baked to a panorama, whose light is that of Cycles."""
    scenes.sky()
    support.addon()
    support.settle(bpy.context.scene, 96, 64, 64)
    bpy.ops.bottega.bake(size=1024)
    theirs = support.picture_of("CYCLES", folder / "bake-sky-cycles.exr", 64)
    ours = support.picture_of("BOTTEGA", folder / "bake-sky.exr", 64)
    difference = bottega.diff(ours, theirs)
    off = max(abs(ratio - 1) for ratio in difference["mean_ratio"])
    notes = {note.fidelity.value for note in support.part("render").Kept.last_report.all()}
    print(f"BAKE sky: mean {100 * off:.2f} % off, FLIP {difference['flip']:.3f}; {notes}", flush=True)
    if off > 0.01 or difference["flip"] > 0.08 or notes != {"baked"}:
        support.failed("the baked sky is another one")


def main() -> None:
    folder = Path(support.arguments()[0])
    support.addon()
    scenes.procedural()
    support.addon()
    support.settle(bpy.context.scene, 96, 64, 64)
    Kept = support.part("render").Kept

    def difference(name: str) -> float:
        ours = support.picture_of("BOTTEGA", folder / f"bake-{name}.exr", 64)
        return bottega.diff(ours, theirs)["flip"]

    def kinds() -> set[str]:
        return {note.fidelity.value for note in Kept.last_report.all()}

    theirs = support.picture_of("CYCLES", folder / "bake-cycles.exr", 64)
    before, kinds_before = difference("before"), kinds()
    bpy.ops.bottega.bake(size=512)
    after, kinds_after = difference("after"), kinds()
    print(f"BAKE FLIP {before:.3f} before, {after:.3f} after; {kinds_before}, {kinds_after}", flush=True)
    if kinds_before != {"left out"} or kinds_after != {"baked"} or after > 0.08 or after > 0.5 * before:
        support.failed("the baked picture is not used")
    bpy.data.materials["Procedural"].node_tree.nodes["Noise Texture"].inputs["Scale"].default_value = 9.0
    difference("changed")
    if "left out" not in kinds():
        support.failed("a picture of other nodes is used")
    sky(folder)
    support.leave()


main()
