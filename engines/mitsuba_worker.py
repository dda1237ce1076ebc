"""The worker of Mitsuba 3 (see line_protocol.py). The scene stays loaded; windows are painted by a loop of our own
over Mitsuba's sensor, sampler and integrator, because `mitsuba.render` compiles a new kernel for each place and size of
a window (0.2 to 1.7 s each). Where the pixels come from is Mitsuba's own: the same sums, the same filter.

`parameters` of `open`: `variant` (default "auto": `llvm_ad_rgb`, or `scalar_rgb` where no LLVM is of use), `sensor`
(index, default 0), and `define` ("name=value name=value": the scene's `<default>` values).
"""

from line_protocol import Line, Refusal, serve, sorted_files

LINE = Line()

import ctypes.util
import glob
import os
import re
import subprocess
import sys

import plain_exr

# LLVM 14 is refused by Dr.Jit 1.5; 15 and 16 end the process ("Cannot select: fminimum").
OLDEST_LLVM = 17
# Samples in flight at once. It does not depend on time, so that equal requests give equal bits.
LANES = 1 << 19
PASSES_OF_SCALAR = 16

TRY_LLVM = """
import drjit as dr
a = dr.arange(dr.llvm.Float, 64)
assert dr.all(dr.minimum(a, dr.opaque(dr.llvm.Float, 3.0)) <= 3.0)
"""


def llvm_libraries():
    """Paths of the LLVM libraries of this machine that are new enough, the newest first."""
    patterns = ["/usr/lib/*/libLLVM*.so*", "/usr/lib*/libLLVM*.so*", "/usr/lib/llvm*/lib/libLLVM*.so*",
                "/usr/local/lib/libLLVM*.so*", "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
                "/usr/local/opt/llvm*/lib/libLLVM*.dylib"]
    found = {}
    for path in sorted(path for pattern in patterns for path in glob.glob(pattern)):
        numbers = re.search(r"libLLVM(?:-|\.so\.|\.)(\d+)", os.path.basename(path)) or re.search(r"llvm[-@]?(\d+)", path)
        if numbers and int(numbers[1]) >= OLDEST_LLVM:
            found.setdefault(os.path.realpath(path), (int(numbers[1]), path))
    return [path for _, path in sorted(found.values(), reverse=True)]


def llvm_works(library):
    """Whether a kernel can be compiled, tried in a process of its own: an LLVM that does not fit aborts."""
    environment = dict(os.environ, DRJIT_LIBLLVM_PATH=library)
    try:
        return subprocess.run([sys.executable, "-c", TRY_LLVM], env=environment, stdin=subprocess.DEVNULL,
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=60).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def choose_llvm():
    """Sets DRJIT_LIBLLVM_PATH to the newest LLVM that works, unless the user has set it. False: there is none."""
    if os.environ.get("DRJIT_LIBLLVM_PATH"):
        return llvm_works(os.environ["DRJIT_LIBLLVM_PATH"])
    for library in llvm_libraries():
        if llvm_works(library):
            os.environ["DRJIT_LIBLLVM_PATH"] = library
            return True
    if ctypes.util.find_library("LLVM") is None and sys.platform == "win32":
        return llvm_works("LLVM-C.dll")
    return False


class Mitsuba:
    name = "mitsuba"

    def __init__(self):
        self.version = mi.__version__

    def open(self, request):
        parameters = request.get("parameters") or {}
        variant = parameters.get("variant") or "auto"
        if variant == "auto":
            variant = "llvm_ad_rgb" if choose_llvm() else "scalar_rgb"
        if variant not in mi.variants():
            raise Refusal(f"this Mitsuba has no variant `{variant}`; it has {', '.join(mi.variants())}")
        mi.set_variant(variant)
        from mitsuba_scene import MitsubaScene
        # Mitsuba waits for ever for image files when Dr.Jit 1.5 has one thread; painting needs no more than one.
        threads = max(1, int(request.get("threads") or 1))
        dr.set_thread_count(max(2, threads))
        self.scene = MitsubaScene(request, variant, int(parameters.get("sensor") or 0), parameters.get("define") or "")
        dr.set_thread_count(threads)
        scene = self.scene
        return {"width": scene.width, "height": scene.height, "first_frame": 1, "last_frame": 1, "frame": 1,
                "layers": scene.layers(), "filter": scene.pixel_filter}

    def paint(self, order, path, progress):
        scene = self.scene
        integrator = scene.integrator_for(order.max_depth, order.light_samples)
        if scene.in_lanes(integrator):
            from mitsuba_lanes import paint_in_lanes
            channels, samples = paint_in_lanes(scene, integrator, order, LANES, progress)
        else:
            channels, samples = scene.paint_by_render(integrator, order, PASSES_OF_SCALAR, progress)
        plain_exr.write(path, order.window.width, order.window.height, channels)
        return order.window, samples

    def files(self, path):
        if mi.variant() is None:
            mi.set_variant("scalar_rgb")
        from mitsuba_scene import referred_files
        return sorted_files(referred_files(path))


if __name__ == "__main__":
    try:
        import drjit as dr
        import mitsuba as mi
    except ImportError as error:
        LINE.fail(f"Mitsuba 3 is not installed for {sys.executable}: {error}", fatal=True)
        LINE.leave(1)
    serve(LINE, Mitsuba())
