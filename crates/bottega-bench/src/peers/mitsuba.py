"""Paints one picture with Mitsuba 3. The scene is FOLDER/SCENE.xml.

usage: FOLDER SCENE SAMPLES SEED THREADS OUT VARIANT
Writes 32-bit RGB, rows from the top, to OUT, and one JSON object with the time of the painting alone to stdout.
"""
import json, os, sys, time

folder, scene, samples, seed, threads, out, variant = sys.argv[1:8]
samples, seed, threads = int(samples), int(seed), int(threads)
if threads == 1 and hasattr(os, "sched_setaffinity"):
    # Dr.Jit hangs with one thread: two on one processor are as good.
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
import drjit
import mitsuba
import numpy

mitsuba.set_variant(variant)
drjit.set_thread_count(max(2, threads))
loaded = mitsuba.load_file(os.path.join(folder, scene + ".xml"), parallel=False, spp=str(samples))
# Compiles what is compiled at the first call.
numpy.array(mitsuba.render(loaded, spp=1, seed=seed + 1_000_000))
start, start_processor = time.perf_counter(), time.process_time()
picture = numpy.array(mitsuba.render(loaded, spp=samples, seed=seed))
seconds, processor = time.perf_counter() - start, time.process_time() - start_processor
picture[:, :, :3].astype("<f4").tofile(out)
print(json.dumps({"seconds": seconds, "processor_seconds": processor, "samples": samples, "version": mitsuba.__version__}), flush=True)
os._exit(0)
