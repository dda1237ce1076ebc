# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed of the add-on, beyond Blender's own evaluation: `bench.py`. Medians, in seconds, beside the greatest that is meant."""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path
from typing import Any, Callable

sys.path.insert(0, str(Path(__file__).parent))

import bottega  # noqa: E402
import bpy  # noqa: E402
import numpy as np  # noqa: E402
import scenes  # noqa: E402
import support  # noqa: E402

TIMES = 5


def report(what: str, seconds: list[float], most: float) -> None:
    print(f"BENCH {what:58} {statistics.median(seconds):7.3f} s   (at most {most:g})", flush=True)


def repeated(run: Callable[[], Any]) -> list[float]:
    times = []
    for _ in range(TIMES):
        begun = time.perf_counter()
        run()
        times.append(time.perf_counter() - begun)
    return times


def grid(side: int) -> Any:
    """Adds a wavy square of 2 × side × side triangles."""
    x, y = np.meshgrid(np.linspace(-2, 2, side + 1, dtype=np.float32), np.linspace(-2, 2, side + 1, dtype=np.float32))
    points = np.stack([x, y, 0.1 * np.sin(5 * x) * np.cos(4 * y)], -1).reshape(-1, 3)
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    quads = np.stack([first, first + 1, first + side + 2, first + side + 1], -1).astype(np.int32)
    mesh = bpy.data.meshes.new("Grid")
    mesh.vertices.add(len(points))
    mesh.vertices.foreach_set("co", points.ravel())
    mesh.loops.add(quads.size)
    mesh.loops.foreach_set("vertex_index", quads.ravel())
    mesh.polygons.add(len(quads))
    mesh.polygons.foreach_set("loop_start", np.arange(0, quads.size, 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    uvs = mesh.uv_layers.new(name="UVMap")
    uvs.data.foreach_set("uv", np.ascontiguousarray(points[quads.ravel()][:, :2] / 4 + 0.5).ravel())
    mesh.materials.append(scenes.matte())
    return scenes.link("Grid", mesh)


def many(count: int) -> None:
    """Adds a collection instance for each of many points, by geometry nodes."""
    mesh = bpy.data.meshes.new("Points")
    mesh.from_pydata([(i % 316 * 0.05, i // 316 * 0.05, 0.0) for i in range(count)], [], [])
    item = scenes.link("Points", mesh)
    group = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    if hasattr(group, "interface"):
        group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    else:
        group.inputs.new("NodeSocketGeometry", "Geometry")
        group.outputs.new("NodeSocketGeometry", "Geometry")
    begin, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    place, cube = group.nodes.new("GeometryNodeInstanceOnPoints"), group.nodes.new("GeometryNodeMeshCube")
    cube.inputs["Size"].default_value = (0.02, 0.02, 0.02)
    group.links.new(begin.outputs[0], place.inputs["Points"])
    group.links.new(cube.outputs[0], place.inputs["Instance"])
    group.links.new(place.outputs[0], end.inputs[0])
    item.modifiers.new("Scatter", "NODES").node_group = group


def exports(what: str, most: float) -> Any:
    Export = support.part("export").Export
    depsgraph = bpy.context.evaluated_depsgraph_get()
    report(what, repeated(lambda: Export().update(depsgraph)), most)
    export = Export()
    export.update(depsgraph)
    return export


def viewport(export: Any, item: Any) -> None:
    """Measures edits of a view of 720 × 480 without Blender's drawing."""
    camera = bottega.Camera.looking((0, 3, 5), (0, 0, 0))
    view = bottega.Viewport(export.scene, size=(720, 480), camera=camera, spp=1024)
    pixels = np.zeros(view.shape, np.float32)
    numbers = iter(range(1, 1000))

    def wait(shown: int | None) -> None:
        while True:
            view.wait(0.01)
            frame = view.frame_into(pixels)
            if frame is not None and frame.look == shown:
                return

    begun = time.perf_counter()
    view.start()
    wait(0)
    report("first pixels of 1 M triangles, after the export", [time.perf_counter() - begun], 1.5)
    turns = []
    for _ in range(20):
        begun = time.perf_counter()
        wait(view.look(camera=bottega.Camera.looking((0.1 * next(numbers), 3, 5), (0, 0, 0))))
        turns.append(time.perf_counter() - begun)
    report("another view, 720 × 480", turns, 0.06)
    report("another view, 720 × 480: 95 %", [sorted(turns)[18]], 0.1)

    def edit(change: Callable[[], None]) -> Callable[[], None]:
        def run() -> None:
            export.update(bpy.context.evaluated_depsgraph_get())
            wait(view.update())

        def both() -> float:
            change()
            bpy.context.view_layer.update()
            begun = time.perf_counter()
            run()
            return time.perf_counter() - begun

        return both  # type: ignore[return-value]

    def mark(scene: Any, depsgraph: Any) -> None:
        export.mark(depsgraph.updates)

    bpy.app.handlers.depsgraph_update_post.append(mark)

    def recolor() -> None:
        node = item.data.materials[0].node_tree.nodes["Diffuse BSDF"]
        node.inputs[0].default_value = (0.01 * next(numbers) % 1.0, 0.5, 0.5, 1.0)

    def relight() -> None:
        bpy.data.lights[0].energy += 1.0

    def move() -> None:
        item.location.z += 0.01

    report("new pixels after a material has changed", [edit(recolor)() for _ in range(TIMES)], 0.1)
    report("new pixels after a light has changed", [edit(relight)() for _ in range(TIMES)], 0.1)
    report("new pixels after an object of 1 M triangles has moved", [edit(move)() for _ in range(TIMES)], 0.3)
    report("stop", repeated(view.stop), 0.3)


def f12() -> None:
    """Measures what F12 takes beyond painting."""
    scenes.factory()
    support.addon()
    scene = bpy.context.scene
    scene.render.engine = "BOTTEGA"
    support.settle(scene, 64, 36, 1)
    bpy.ops.render.render()
    report("F12 of the factory scene beyond painting", repeated(bpy.ops.render.render), 0.5)
    render = support.part("render")
    scene.bottega.samples = 4
    scene.render.resolution_x, scene.render.resolution_y = 1920, 1080
    layer = bpy.context.view_layer
    layer.use_pass_z = layer.use_pass_normal = layer.use_pass_mist = scene.bottega.use_albedo = True
    times: list[float] = []
    deliver = render._deliver

    def timed(*arguments: Any) -> None:
        begun = time.perf_counter()
        deliver(*arguments)
        times.append(time.perf_counter() - begun)

    render._deliver = timed
    for _ in range(3):
        bpy.ops.render.render()
    render._deliver = deliver
    report("combined and four passes, 1920 × 1080, into the result", times, 0.25)


def main() -> None:
    support.addon()
    scenes.empty()
    item = grid(708)
    scenes.add_light("AREA", (0, 0, 4), energy=100)
    support.addon()
    export = exports("export: 1 M triangles", 0.8)
    viewport(export, item)
    scenes.empty()
    many(100_000)
    support.addon()
    exports("export: 100,000 instances", 2.5)
    scenes.empty()
    material, tree, output = scenes.nodes("Large")
    image, diffuse = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeBsdfDiffuse")
    image.image = scenes.picture("Large", 4096, 4096)
    tree.links.new(image.outputs[0], diffuse.inputs[0])
    tree.links.new(diffuse.outputs[0], output.inputs[0])
    scenes.floor(material)
    support.addon()
    exports("export: a picture of 4096 × 4096", 1.0)
    f12()
    support.leave()


main()
