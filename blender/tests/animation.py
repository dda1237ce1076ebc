# SPDX-License-Identifier: GPL-3.0-or-later
"""Animations: with Persistent Data, where only what moved is read again, frames have the same bits as without; also those with motion
blur, which files that are written have, too. `animation.py FOLDER`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import bottega  # noqa: E402
import bpy  # noqa: E402
import numpy as np  # noqa: E402
import scenes  # noqa: E402
import support  # noqa: E402

FRAMES = 4


def keyed() -> None:
    """Makes a scene in which an object, a light, a camera, a material and a shape change over time."""
    scenes.textured_room()
    cube = bpy.data.objects["Cube"]
    for frame, x in ((1, -1.0), (FRAMES, 1.0)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
        light = next(light for light in bpy.data.lights)
        light.energy = 100.0 * frame
        light.keyframe_insert("energy", frame=frame)
        camera = bpy.context.scene.camera
        camera.location.z = 3.0 + 0.1 * frame
        camera.keyframe_insert("location", frame=frame)
        node = bpy.data.materials["Matte"].node_tree.nodes["Diffuse BSDF"]
        node.inputs[0].default_value = (0.2 * frame, 0.3, 0.1, 1.0)
        node.inputs[0].keyframe_insert("default_value", frame=frame)
    wave = bpy.data.objects["Floor"].modifiers.new("Wave", "WAVE")
    wave.height = 0.3


def frames(folder: Path, name: str, persistent: bool) -> list[Any]:
    scene = bpy.context.scene
    scene.render.engine = "BOTTEGA"
    scene.render.use_persistent_data = persistent
    scene.frame_start, scene.frame_end = 1, FRAMES
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(folder / f"{name}-")
    bpy.ops.render.render(animation=True)
    return [bottega.read(folder / f"{name}-{frame:04}.exr").color for frame in range(1, FRAMES + 1)]


def compare(name: str, alone: list[Any], kept: list[Any]) -> None:
    """Fails if frames differ by Persistent Data, or if two frames are the same."""
    for number, (one, other) in enumerate(zip(alone, kept), 1):
        if not support.is_same(one, other):
            support.failed(f"frame {number} of {name} has other bits with Persistent Data")
    if any(np.array_equal(one, other) for one, other in zip(alone, alone[1:])):
        support.failed(f"two frames of {name} are the same")
    print(f"ANIMATION {FRAMES} frames of {name} have the same bits with Persistent Data", flush=True)


def blur(folder: Path) -> None:
    """Renders the frames with motion blur, and compares them with those of an export that is kept, and of a file."""
    keyed()
    scenes.add_light("SPOT", (-2, -2, 3), energy=100)
    scenes.moved(bpy.data.objects["Spot"], "rotation_euler", (0, 0, 0), (0.5, 0.2, 0))
    support.addon()
    scene = bpy.context.scene
    support.settle(scene, 48, 32, 4)
    sharp = frames(folder, "sharp", False)
    evaluations: list[float] = []

    def count(changed: Any, *_: Any) -> None:
        evaluations.append(changed.frame_current + changed.frame_subframe)

    bpy.app.handlers.frame_change_post.append(count)
    scene.frame_set(2)
    evaluations.clear()
    still(folder, "once")
    # What Blender evaluates itself, before and after the picture
    own = list(evaluations)
    if any(time != 2.0 for time in own):
        support.failed(f"without motion blur the scene is evaluated at {own}")
    for position, times in (("CENTER", [1.75, 2.25, 2.0]), ("START", [2.5, 2.0, 2.25, 2.0])):
        scenes.blurred(scene, 0.5, position)
        scene.frame_set(2)
        evaluations.clear()
        picture = still(folder, position)
        is_back = (scene.frame_current, scene.frame_subframe) == (2, 0.0)
        if sorted(evaluations) != sorted([*own, *times]) or not is_back:
            support.failed(f"the scene is evaluated at {evaluations}, and left at {scene.frame_current} + {scene.frame_subframe}")
        if np.array_equal(picture, sharp[1]):
            support.failed("motion blur changes nothing")
        file, output = folder / "blurred.bottega", folder / "blurred-line.exr"
        if bpy.ops.bottega.save_scene(filepath=str(file)) != {"FINISHED"}:
            support.failed("the scene cannot be written")
        program = support.part("library").program("bottega")
        subprocess.run([str(program), "render", str(file), "-o", str(output)], check=True, stdout=subprocess.DEVNULL)
        if not support.is_same(picture, bottega.read(output).color):
            support.failed("the file of a blurred scene renders to other bits")
    bpy.app.handlers.frame_change_post.remove(count)
    print("ANIMATION motion blur evaluates the scene once for each key, and files have its bits", flush=True)
    compare("motion blur", *(frames(folder, f"blurred-{kept}", kept) for kept in (False, True)))
    scene.render.use_motion_blur = False
    if not all(support.is_same(one, other) for one, other in zip(sharp, frames(folder, "sharp-kept", True))):
        support.failed("an export that is kept has other bits after motion blur is switched off")


def still(folder: Path, name: str) -> Any:
    """Renders the current frame by Bottega, without Persistent Data."""
    bpy.context.scene.render.use_persistent_data = False
    return support.picture_of("BOTTEGA", folder / f"still-{name}.exr", 4)


def sequence(folder: Path) -> None:
    """Renders pictures of a sequence, which begins at frame 2 and repeats, and compares each frame with Cycles."""
    scenes.empty((0.8, 0.8, 0.8))
    for number in range(1, 4):
        image = bpy.data.images.new("still", 8, 8)
        image.pixels = [0.3 * (number == channel + 1) + 0.1 for channel in range(4)] * 64
        image.filepath_raw, image.file_format = str(folder / f"sequence-{number:03}.png"), "PNG"
        image.save()
        bpy.data.images.remove(image)
    material, tree, output = scenes.nodes("Sequence")
    shader, texture = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.load(str(folder / "sequence-001.png"))
    texture.image.source = "SEQUENCE"
    user = texture.image_user
    user.frame_start, user.frame_duration, user.use_cyclic, user.use_auto_refresh = 2, 3, True, True
    tree.links.new(texture.outputs["Color"], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    scenes.floor(material)
    support.addon()
    support.settle(bpy.context.scene, 48, 32, 16)
    for persistent in (False, True):
        bpy.context.scene.render.use_persistent_data = persistent
        for frame in range(1, 7):
            bpy.context.scene.frame_set(frame)
            theirs, ours = (support.picture_of(engine, folder / f"sequence-{engine.lower()}.exr", 16)[20:].mean((0, 1)) for engine in ("CYCLES", "BOTTEGA"))
            if np.abs(ours / theirs - 1).max() > 0.02:
                support.failed(f"frame {frame} of the sequence is {ours}, and {theirs} by Cycles")
    print("ANIMATION a sequence of pictures is that of Cycles", flush=True)


def main() -> None:
    folder = Path(support.arguments()[0])
    support.addon()
    keyed()
    support.addon()
    support.settle(bpy.context.scene, 48, 32, 4)
    alone, kept = (frames(folder, name, persistent) for name, persistent in (("animation", False), ("persistent", True)))
    compare("a room", alone, kept)
    blur(folder)
    sequence(folder)
    support.leave()


main()
