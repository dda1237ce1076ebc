#!/usr/bin/env python3
"""Paints full frames of a scene by an engine's own interface, as its users would, without worker, windows and protocol:

    python3 engines/tests/full_frame.py mitsuba|cycles|luxcore|povray SCENE --size WxH --samples N --seeds 1,2,3 -o FOLDER

writes FOLDER/SEED.exr for each seed. `cargo xtask engines` holds pictures that bottega paints in zones to these.
"""

import argparse
import math
import os
import re
import subprocess
import sys
from xml.etree import ElementTree

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [os.path.dirname(HERE)]

import plain_exr


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("name", choices=sorted(PAINTERS))
    parser.add_argument("scene")
    parser.add_argument("--size", required=True)
    parser.add_argument("--samples", type=int, required=True)
    parser.add_argument("--seeds", required=True)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("-o", "--output", required=True)
    task = parser.parse_args()
    task.width, task.height = map(int, task.size.split("x"))
    # Engines change their folder.
    task.scene, task.output = os.path.abspath(task.scene), os.path.abspath(task.output)
    os.makedirs(task.output, exist_ok=True)
    paint = PAINTERS[task.name](task)
    for seed in map(int, task.seeds.split(",")):
        paint(seed, os.path.join(task.output, f"{seed}.exr"))


def mitsuba(task):
    # Finds an LLVM that works, and nothing else.
    from mitsuba_worker import choose_llvm
    has_llvm = choose_llvm()
    import mitsuba as mi
    import numpy as np
    mi.set_variant("llvm_ad_rgb" if has_llvm else "scalar_rgb")
    # The size goes into the scene's text: a sensor does not look at its film again.
    tree = ElementTree.parse(task.scene)
    for film in tree.iter("film"):
        # All of it, whatever crop the scene has.
        for side in [side for side in film if re.fullmatch(r"width|height|crop_\w+", side.get("name", ""))]:
            film.remove(side)
        ElementTree.SubElement(film, "integer", name="width", value=str(task.width))
        ElementTree.SubElement(film, "integer", name="height", value=str(task.height))
    os.chdir(os.path.dirname(task.scene))
    scene = mi.load_string(ElementTree.tostring(tree.getroot(), "unicode"))

    def paint(seed, path):
        picture = np.array(mi.render(scene, spp=task.samples, seed=seed), np.float32)
        plain_exr.write(path, task.width, task.height,
                        {name: np.ascontiguousarray(picture[..., index]) for index, name in enumerate("RGB")})
    return paint


def cycles(task):
    import bpy
    from line_protocol import Order
    if task.scene.lower().endswith(".blend"):
        bpy.ops.wm.open_mainfile(filepath=task.scene, load_ui=False, use_scripts=False)
    else:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        # As the worker has it read, for the light's units and Cycles' own losses are a matter of reading: see docs/engines.md.
        bpy.ops.import_scene.gltf(filepath=task.scene, export_import_convert_lighting_mode="COMPAT")
        own = bpy.context.scene.cycles
        own.sample_clamp_direct = own.sample_clamp_indirect = own.blur_glossy = own.light_sampling_threshold = 0.0
        own.caustics_reflective = own.caustics_refractive = True
    scene = bpy.context.scene
    scene.camera = scene.camera or next(thing for thing in scene.objects if thing.type == "CAMERA")
    render, own = scene.render, scene.cycles
    render.engine, own.device = "CYCLES", "CPU"
    render.threads_mode, render.threads = "FIXED", task.threads
    render.resolution_x, render.resolution_y, render.resolution_percentage = task.width, task.height, 100
    # What sees more than its own pixel belongs to the whole picture, and is left out on both sides.
    own.use_adaptive_sampling = own.use_denoising = render.use_compositing = render.use_sequencer = False
    own.samples = task.samples
    output = render.image_settings
    output.file_format = "OPEN_EXR"
    output.color_mode, output.color_depth, output.exr_codec = "RGB", "32", "NONE"
    # The same random numbers as the worker's: a hash of the seed, told by the protocol.
    window = {"id": 0, "window": [0, 0, task.width, task.height], "samples": task.samples}

    def paint(seed, path):
        own.seed = Order(dict(window, seed=seed), task.width, task.height).hashed_seed(31)
        render.filepath = path
        bpy.ops.render.render(write_still=True)
    return paint


def luxcore(task):
    import numpy as np
    import pyluxcore
    pyluxcore.Init()
    folder = os.path.dirname(task.scene)
    os.chdir(folder)
    pyluxcore.AddFileNameResolverPath(folder)
    config = pyluxcore.Properties()
    described = task.scene
    if described.lower().endswith(".cfg"):
        config = pyluxcore.Properties(described)
        described = os.path.join(folder, config.Get("scene.file").GetString())
    told = pyluxcore.Properties(described)
    scene = pyluxcore.Scene()
    scene.Parse(told)
    # LuxCore's row y is what is seen in row y - 1: a row more is painted at the bottom, and the top one left out.
    aspect = task.width / task.height
    screen = [-1.0, 1.0, -1 / aspect, 1 / aspect] if aspect >= 1 else [-aspect, aspect, -1.0, 1.0]
    if told.IsDefined("scene.camera.screenwindow"):
        screen = [float(number) for number in told.Get("scene.camera.screenwindow").Get()]
    screen[2] -= (screen[3] - screen[2]) / task.height
    camera = {name: told.Get(name).Get() for name in told.GetAllNames() if name.startswith("scene.camera.")}
    camera["scene.camera.screenwindow"] = screen
    scene.Parse(properties(pyluxcore, camera))
    rows = task.height + 1
    kept = {name: config.Get(name).Get() for name in config.GetAllNames() if name.startswith(("path.", "sampler.", "film.filter."))}

    def paint(seed, path):
        values = dict(kept, **{
            "renderengine.type": ["PATHCPU"], "renderengine.seed": [seed + 1], "film.width": [task.width],
            "film.height": [rows], "batch.haltspp": [task.samples], "native.threads.count": [task.threads],
            "film.imagepipelines.0.0.type": ["NOP"], "path.hybridbackforward.enable": [False],
            "sampler.sobol.adaptive.strength": [0.0], "film.noiseestimation.warmup": [0],
            "film.outputs.0.type": ["RGB"], "film.outputs.0.filename": ["rgb.exr"]})
        session = pyluxcore.RenderSession(pyluxcore.RenderConfig(properties(pyluxcore, values), scene))
        session.Start()
        while not session.HasDone():
            session.UpdateStats()
        picture = np.zeros((rows, task.width, 3), np.float32)
        session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, picture)
        session.Stop()
        # The first row is the lowest.
        picture = picture[::-1][1:]
        plain_exr.write(path, task.width, task.height,
                        {name: np.ascontiguousarray(picture[..., index]) for index, name in enumerate("RGB")})
    return paint


def properties(pyluxcore, values):
    made = pyluxcore.Properties()
    for name, value in values.items():
        made.Set(pyluxcore.Property(name, value))
    return made


def povray(task):
    grid = math.isqrt(task.samples)
    if grid * grid != task.samples:
        raise SystemExit(f"POV-Ray takes 1, 4, 9, … samples, not {task.samples}")
    folder = os.path.dirname(task.scene)

    def paint(seed, path):
        # POV-Ray has no seeds: every picture is the same.
        grid_words = [f"Antialias_Depth={grid}", "Antialias=on", "Sampling_Method=1", "Antialias_Threshold=0.0",
                      "Jitter=off"] if grid > 1 else ["Antialias=off"]
        words = [os.environ.get("BOTTEGA_POVRAY", "povray"), f"Input_File_Name={task.scene}", f"Output_File_Name={path}",
                 f"Width={task.width}", f"Height={task.height}", "Output_File_Type=E", "File_Gamma=1.0",
                 f"Work_Threads={task.threads}", "Display=off", f"Library_Path={folder}"] + grid_words
        done = subprocess.run(words, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                              stderr=subprocess.PIPE, env=dict(os.environ, HOME=os.path.dirname(path)))
        if done.returncode != 0:
            raise SystemExit(done.stderr.decode(errors="replace")[-2000:])
    return paint


PAINTERS = {"mitsuba": mitsuba, "cycles": cycles, "luxcore": luxcore, "povray": povray}

if __name__ == "__main__":
    main()
