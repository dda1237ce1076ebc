"""Paints one picture with Cycles, from Blender as a Python module. The scene is FOLDER/SCENE.json and its meshes.

usage: FOLDER SCENE SAMPLES SEED THREADS OUT
Writes 32-bit RGB, rows from the top, to OUT, and one JSON object with the time of the painting alone to stdout.
"""
import json, math, os, sys, tempfile, time

folder, name, samples, seed, threads, out = sys.argv[1:7]
if int(threads) == 1 and hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
answer = os.dup(1)
os.dup2(2, 1)
import bpy
import numpy
from mathutils import Matrix, Vector

with open(os.path.join(folder, name + ".json")) as file:
    neutral = json.load(file)
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene


def surface(label, material, emission):
    """A material of one node: what scatters, or what shines."""
    made = bpy.data.materials.new(label)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    kinds = {"diffuse": "ShaderNodeBsdfDiffuse", "dielectric": "ShaderNodeBsdfGlass", "mirror": "ShaderNodeBsdfAnisotropic"}
    if emission:
        node = tree.nodes.new("ShaderNodeEmission")
        node.inputs["Strength"].default_value = max(emission)
        color = [channel / max(emission) for channel in emission]
    else:
        node = tree.nodes.new(kinds[material["type"]])
        node.inputs["Roughness"].default_value = 0
        color = material.get("reflectance", [1, 1, 1])
        if material["type"] == "dielectric":
            node.inputs["IOR"].default_value = material["ior"]
    node.inputs["Color"].default_value = (*color, 1)
    tree.links.new(node.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    if emission:
        made.cycles.emission_sampling = "FRONT"
    return made


def read_ply(path):
    """Positions and triangles of a little-endian PLY of nothing else."""
    with open(path, "rb") as file:
        content = file.read()
    body = content.index(b"end_header\n") + 11
    words = content[:body].split()
    vertices, faces = (int(words[words.index(what) + 1]) for what in (b"vertex", b"face"))
    positions = numpy.frombuffer(content, "<f4", vertices * 3, body)
    corners = numpy.frombuffer(content, numpy.dtype([("n", "u1"), ("at", "<i4", 3)]), faces, body + vertices * 12)
    return positions, corners["at"].ravel()


materials = {}
for entry in neutral["meshes"]:
    positions, corners = read_ply(os.path.join(folder, entry["ply"]))
    mesh = bpy.data.meshes.new(entry["name"])
    mesh.vertices.add(len(positions) // 3)
    mesh.vertices.foreach_set("co", positions)
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", corners.astype("i4"))
    mesh.polygons.add(len(corners) // 3)
    mesh.polygons.foreach_set("loop_start", numpy.arange(0, len(corners), 3, dtype="i4"))
    mesh.update(calc_edges=True)
    mesh.shade_flat()
    key = (entry["material"], tuple(entry.get("emission", ())))
    if key not in materials:
        materials[key] = surface(str(key), neutral["materials"][entry["material"]], entry.get("emission"))
    mesh.materials.append(materials[key])
    scene.collection.objects.link(bpy.data.objects.new(entry["name"], mesh))

look = neutral["camera"]
back = (Vector(look["origin"]) - Vector(look["target"])).normalized()
right = Vector(look["up"]).cross(back).normalized()
up = back.cross(right)
lens = bpy.data.cameras.new("camera")
lens.sensor_fit, lens.angle, lens.clip_start, lens.clip_end = "HORIZONTAL", math.radians(look["fov"]), 0.01, 1000
scene.camera = bpy.data.objects.new("camera", lens)
scene.camera.matrix_world = Matrix([(*column, at) for *column, at in zip(right, up, back, look["origin"])] + [(0, 0, 0, 1)])
scene.collection.objects.link(scene.camera)
world = scene.world = bpy.data.worlds.new("world")
world.use_nodes = True
world.node_tree.nodes.clear()
sky = world.node_tree.nodes.new("ShaderNodeBackground")
sky.inputs["Color"].default_value = (*neutral.get("env", (0, 0, 0)), 1)
world.node_tree.links.new(sky.outputs[0], world.node_tree.nodes.new("ShaderNodeOutputWorld").inputs["Surface"])

# No clamping, no denoising, no adaptive sampling: what is compared is the estimate alone.
chosen = {
    scene.render: dict(
        engine="CYCLES", resolution_x=neutral["width"], resolution_y=neutral["height"], resolution_percentage=100,
        threads_mode="FIXED", threads=int(threads), use_compositing=False, use_sequencer=False, dither_intensity=0,
        film_transparent=False, use_file_extension=False,
    ),
    scene.cycles: dict(
        device="CPU", samples=int(samples), seed=int(seed), use_adaptive_sampling=False, use_denoising=False,
        sample_clamp_direct=0, sample_clamp_indirect=0, blur_glossy=0, light_sampling_threshold=0, min_light_bounces=0,
        min_transparent_bounces=0, caustics_reflective=True, caustics_refractive=True, pixel_filter_type="BOX", filter_width=1,
        use_auto_tile=False, time_limit=0,
    ),
    scene.render.image_settings: dict(file_format="OPEN_EXR", color_mode="RGB", color_depth="32"),
}
for kind in ("", "diffuse_", "glossy_", "transmission_", "volume_"):
    chosen[scene.cycles][kind + "bounces" if kind else "max_bounces"] = neutral["max_bounces"]
chosen[scene.cycles]["transparent_max_bounces"] = neutral["max_bounces"]
for target, values in chosen.items():
    for key, value in values.items():
        setattr(target, key, value)

with tempfile.TemporaryDirectory() as kept:
    scene.render.filepath = os.path.join(kept, "picture.exr")
    # It builds its tree within this time: some tenths of a second.
    start, start_processor = time.perf_counter(), time.process_time()
    bpy.ops.render.render(write_still=True)
    seconds, processor = time.perf_counter() - start, time.process_time() - start_processor
    loaded = bpy.data.images.load(scene.render.filepath)
    loaded.colorspace_settings.name = "Non-Color"
    pixels = numpy.empty(neutral["width"] * neutral["height"] * 4, "f4")
    loaded.pixels.foreach_get(pixels)
pixels.reshape(neutral["height"], neutral["width"], 4)[::-1, :, :3].astype("<f4").tofile(out)
spent = {"seconds": seconds, "processor_seconds": processor, "samples": int(samples), "version": bpy.app.version_string}
os.write(answer, json.dumps(spent).encode() + b"\n")
os._exit(0)
