"""Paints one picture with LuxCore's path tracer. The scene is FOLDER/SCENE.scn; its depth and size are in FOLDER/SCENE.json.

usage: FOLDER SCENE SAMPLES SEED THREADS OUT
Writes 32-bit RGB, rows from the top, to OUT, and one JSON object with the time of the painting alone to stdout.
"""
import json, os, sys, time

folder, scene, samples, seed, threads, out = sys.argv[1:7]
out = os.path.abspath(out)
os.chdir(folder)
with open(scene + ".json") as file:
    neutral = json.load(file)
if int(threads) == 1 and hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
# The engine prints to stdout, which is kept for the answer.
answer = os.dup(1)
os.dup2(2, 1)
import pyluxcore

pyluxcore.Init()
described = pyluxcore.Scene()
described.Parse(pyluxcore.Properties(scene + ".scn"))
# Its depth counts the camera's ray and the last one to the light.
depth = neutral["max_bounces"] + 2
settings = {
    "renderengine.type": "PATHCPU",
    "renderengine.seed": int(seed) + 1,
    "native.threads.count": int(threads),
    "film.width": neutral["width"],
    "film.height": neutral["height"],
    "film.filter.type": "NONE",
    "film.imagepipelines.0.0.type": "NOP",
    "film.noiseestimation.warmup": 0,
    "path.clamping.variance.maxvalue": 0,
    "sampler.type": "SOBOL",
    "sampler.sobol.adaptive.strength": 0.0,
    "batch.haltspp": int(samples),
}
for kind in ("total", "diffuse", "glossy", "specular"):
    settings["path.pathdepth." + kind] = depth
properties = pyluxcore.Properties()
for name, value in settings.items():
    properties.Set(pyluxcore.Property(name, [value]))
session = pyluxcore.RenderSession(pyluxcore.RenderConfig(properties, described))
start, start_processor = time.perf_counter(), time.process_time()
session.Start()
while not session.HasDone():
    time.sleep(0.02)
    session.UpdateStats()
session.UpdateStats()
seconds, processor = time.perf_counter() - start, time.process_time() - start_processor
taken = session.GetStats().Get("stats.renderengine.total.samplecount").GetFloat()
session.Stop()
width, height = neutral["width"], neutral["height"]
pixels = bytearray(width * height * 3 * 4)
session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, pixels, 0)
row = width * 12
with open(out, "wb") as file:
    for y in reversed(range(height)):
        file.write(pixels[y * row : (y + 1) * row])
spent = {"seconds": seconds, "processor_seconds": processor, "samples": taken / (width * height), "version": pyluxcore.Version()}
os.write(answer, json.dumps(spent).encode() + b"\n")
os._exit(0)
