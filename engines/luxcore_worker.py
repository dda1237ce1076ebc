"""The worker of LuxCore (see line_protocol.py). It paints with LuxCore's path tracer on the CPU, whatever engine the
scene names: the others cannot paint windows (tiles stay empty, light paths land outside, Metropolis looks elsewhere).

Scenes: `.cfg` (with `scene.file`) and `.scn`. (pyluxcore 2.11 does not read the `.bsc` files that it writes, and gives the
cameras of `.lxs` files names that it does not know.) The scene stays loaded; LuxCore builds its tree of triangles
anew for each window, because the seed, the number of samples and the window are fixed when a session starts.

`parameters` of `open`: `config` ("key=value key=value", over the scene's own configuration).
"""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from line_protocol import Line, Refusal, layers_of, serve, sorted_files

LINE = Line()

import time

import plain_exr

FAR = 1e10
DEFAULT_FRAME = (640, 480)
# Looking takes time from the painting, and LuxCore stops only when it is looked at: after so much of the time that is left,
# but no more than has gone by.
LEAST_WAIT, MOST_WAIT, SHARE_OF_WAIT = 0.002, 0.1, 0.7

# Outputs of a configuration that can be cut: layer, channels.
LAYER_OF_OUTPUT = {
    "ALPHA": ("", "A"), "DEPTH": ("depth", "Z"), "POSITION": ("position", "XYZ"), "UV": ("uv", "UV"),
    "ALBEDO": ("albedo", "RGB"), "SHADING_NORMAL": ("normal", "XYZ"), "AVG_SHADING_NORMAL": ("mean_normal", "XYZ"),
    "GEOMETRY_NORMAL": ("geometric_normal", "XYZ"), "DIRECT_DIFFUSE": ("direct_diffuse", "RGB"),
    "DIRECT_GLOSSY": ("direct_glossy", "RGB"), "EMISSION": ("emission", "RGB"),
    "INDIRECT_DIFFUSE": ("indirect_diffuse", "RGB"), "INDIRECT_GLOSSY": ("indirect_glossy", "RGB"),
    "INDIRECT_SPECULAR": ("indirect_specular", "RGB"), "DIRECT_SHADOW_MASK": ("direct_shadow_mask", "Y"),
    "INDIRECT_SHADOW_MASK": ("indirect_shadow_mask", "Y"), "IRRADIANCE": ("irradiance", "RGB"),
    "MATERIAL_ID_COLOR": ("material_id", "RGB"), "CAUSTIC": ("caustic", "RGB"),
}

# What LuxCore takes from the nearest sample of a pixel and does not average.
PICKED = ("depth", "position", "uv", "normal", "geometric_normal", "material_id")

# What a window must not do by itself, or has no use for.
FIXED = {
    "renderengine.type": ["PATHCPU"], "path.hybridbackforward.enable": [False], "film.noiseestimation.warmup": [0],
    "film.noiseestimation.step": [0], "batch.haltthreshold": [-1.0], "batch.halttime": [0],
    "sampler.sobol.adaptive.strength": [0.0], "sampler.random.adaptive.strength": [0.0],
    "film.imagepipelines.0.0.type": ["NOP"], "periodicsave.film.outputs.period": [0.0],
    "periodicsave.film.period": [0.0], "periodicsave.resumerendering.period": [0.0],
}
DEPTHS = ("total", "diffuse", "glossy", "specular")
FILE_SUFFIXES = (".file", ".ply", ".iesfile", ".mapfile", ".lightmapfile", ".vdb", ".curvestrands", ".strands")


def properties(values):
    made = pyluxcore.Properties()
    for name, value in values.items():
        made.Set(pyluxcore.Property(name, value))
    return made


def value_of(props, name, default):
    """The first value of a property, as text; `default` where it is not set."""
    return props.Get(name).GetString() if props.IsDefined(name) else default


def read_scene(path):
    """-> (properties of the configuration, properties of the scene)."""
    folder = os.path.dirname(os.path.abspath(path))
    os.chdir(folder)
    pyluxcore.ClearFileNameResolverPaths()
    pyluxcore.AddFileNameResolverPath(folder)
    kind = os.path.splitext(path)[1].lower()
    config = pyluxcore.Properties()
    if kind == ".cfg":
        config = pyluxcore.Properties(path)
        name = value_of(config, "scene.file", None)
        if name is None:
            raise Refusal(f"{path} has no `scene.file`")
        path = name if os.path.isfile(name) else os.path.join(folder, name)
        pyluxcore.AddFileNameResolverPath(os.path.dirname(os.path.abspath(path)))
        kind = os.path.splitext(path)[1].lower()
    if kind != ".scn":
        raise Refusal(f"{path}: LuxCore is given .cfg and .scn files here")
    return config, pyluxcore.Properties(path)


def referred_files(path):
    """Files that properties name, by the key or because there is such a file."""
    config, scene = read_scene(path)
    folder = os.path.dirname(os.path.abspath(path))
    found = set()
    name = value_of(config, "scene.file", None)
    scene_folder = folder
    if name:
        scene_file = os.path.join(folder, name)
        scene_folder = os.path.dirname(scene_file)
        found.add(scene_file)
    for props in (config, scene):
        for key in props.GetAllNames():
            if not key.startswith("scene.") or key == "scene.file":
                continue
            for value in (text for text in props.Get(key).Get() if isinstance(text, str)):
                places = [os.path.join(base, value) for base in (folder, scene_folder)]
                there = next((place for place in places if os.path.isfile(place)), None)
                if there or (value and key.endswith(FILE_SUFFIXES)):
                    found.add(there or places[-1])
    return {os.path.normpath(file) for file in found} - {os.path.abspath(path)}


class LuxCore:
    name = "luxcore"

    def __init__(self):
        self.version = pyluxcore.Version()
        self.scene = None

    def open(self, request):
        self.scene = None
        config, scene = read_scene(request["scene"])
        self.threads = max(1, int(request.get("threads") or 1))
        self._configure(config, request)
        self.scene = pyluxcore.Scene()
        self.scene.Parse(scene)
        self._move_camera_a_row(scene)
        layers = layers_of([f"{layer}.{name}" for layer, names in self.outputs.values() if layer for name in names],
                           picked=PICKED)
        return {"width": self.width, "height": self.height, "first_frame": 1, "last_frame": 1, "frame": 1,
                "layers": layers}

    def _configure(self, config, request):
        self.width = int(request.get("width") or value_of(config, "film.width", DEFAULT_FRAME[0]))
        self.height = int(request.get("height") or value_of(config, "film.height", DEFAULT_FRAME[1]))
        kept, outputs = {}, {}
        for name in config.GetAllNames():
            if name.startswith("film.outputs.") and name.endswith(".type"):
                kind = config.Get(name).GetString()
                if kind in ("RGBA", "RGBA_IMAGEPIPELINE", "RGBA_TONEMAPPED"):
                    kind = "ALPHA"
                if kind in LAYER_OF_OUTPUT:
                    outputs[kind] = LAYER_OF_OUTPUT[kind]
            elif not name.startswith(("film.outputs.", "film.imagepipeline", "film.subregion", "scene.", "film.denoiser",
                                      "periodicsave.", "batch.", "film.noiseestimation", "opencl.", "resumerendering.",
                                      "path.photongi", "renderengine.", "screen.", "image.")):
                kept[name] = config.Get(name).Get()
        if kept.get("sampler.type", ["SOBOL"])[0] not in ("SOBOL", "RANDOM"):
            kept["sampler.type"] = ["SOBOL"]
        extra = (request.get("parameters") or {}).get("config") or ""
        kept.update((key, value.split(",")) for key, value in (item.split("=", 1) for item in extra.split()))
        kept.update(FIXED)
        kept.update({"film.width": [self.width], "film.height": [self.height],
                     "native.threads.count": [self.threads]})
        for index, kind in enumerate(outputs):
            kept[f"film.outputs.{index}.type"] = [kind]
            kept[f"film.outputs.{index}.filename"] = [f"{kind.lower()}.exr"]
        self.config, self.outputs = kept, outputs

    def _move_camera_a_row(self, camera):
        """LuxCore's pictures are a row too low (it takes film row y for row y + 1): the screen goes down by a row."""
        names = [name for name in camera.GetAllNames() if name.startswith("scene.camera.")]
        values = {name: camera.Get(name).Get() for name in names}
        if values.get("scene.camera.type", ["perspective"])[0] not in ("perspective", "orthographic"):
            return
        aspect = self.width / self.height
        screen = values.get("scene.camera.screenwindow")
        if screen is None:
            screen = [-1, 1, -1 / aspect, 1 / aspect] if aspect >= 1 else [-aspect, aspect, -1, 1]
        left, right, bottom, top = (float(number) for number in screen)
        row = (top - bottom) / self.height
        values["scene.camera.screenwindow"] = [left, right, bottom - row, top - row]
        self.scene.Parse(properties(values))

    def paint(self, order, path, progress):
        window = order.window
        config = dict(self.config)
        # Rows count from below, and the last ones belong to the window.
        config["film.subregion"] = [window.x0, window.x1 - 1, self.height - window.y1, self.height - 1 - window.y0]
        config["batch.haltspp"] = [order.samples]
        config["renderengine.seed"] = [order.hashed_seed(31, *window.as_list())]
        if order.max_depth is not None:
            # LuxCore counts edges of the path: 2 is direct light only.
            config.update({f"path.pathdepth.{kind}": [order.max_depth + 2] for kind in DEPTHS})
        session = pyluxcore.RenderSession(pyluxcore.RenderConfig(properties(config), self.scene))
        session.Start()
        try:
            share = self._wait(session, order, progress)
            channels = self._channels(session.GetFilm(), window)
        finally:
            session.Stop()
        plain_exr.write(path, window.width, window.height, channels)
        return window, max(1, int(share * order.samples))

    def _wait(self, session, order, progress):
        """Until all samples are taken; returns how many were, as a share of those asked for."""
        pixels = order.window.width * order.window.height
        started = time.monotonic()
        while True:
            session.UpdateStats()
            stats = session.GetStats()
            share = stats.Get("stats.renderengine.total.samplecount").GetFloat() / (pixels * order.samples)
            is_late = order.time is not None and time.monotonic() - started > order.time
            # All pixels have a sample, at least.
            if session.HasDone() or (is_late and share * order.samples >= 1):
                return share
            progress(min(share, 1.0))
            gone = time.monotonic() - started
            left = gone * (1 - share) / max(share, 1e-6)
            time.sleep(min(max(min(left * SHARE_OF_WAIT, gone), LEAST_WAIT), MOST_WAIT))

    def _channels(self, film, window):
        channels = self._cut(film, "RGB", "RGB", window)
        found = {name: channels[index] for index, name in enumerate("RGB")}
        for kind, (layer, names) in self.outputs.items():
            for name, plane in zip(names, self._cut(film, kind, names, window)):
                found[f"{layer}.{name}" if layer else name] = plane
        return found

    def _cut(self, film, kind, names, window):
        """Planes of an output within the window, top row first. LuxCore's first row is the lowest."""
        count = len(names)
        whole = np.zeros((self.height, self.width, count), np.float32)
        film.GetOutputFloat(getattr(pyluxcore.FilmOutputType, kind), whole)
        part = whole[::-1][window.y0:window.y1, window.x0:window.x1]
        if kind == "DEPTH":
            part = np.where(np.isfinite(part), part, np.float32(FAR))  # What is not there is at no finite depth.
        return [np.ascontiguousarray(part[..., index]) for index in range(count)]

    def files(self, path):
        here = os.getcwd()
        try:
            return sorted_files(referred_files(path))
        finally:
            os.chdir(here)


if __name__ == "__main__":
    try:
        import pyluxcore
        import numpy as np
    except ImportError as error:
        LINE.fail(f"pyluxcore or numpy is not installed for {sys.executable}: {error}", fatal=True)
        LINE.leave(1)
    pyluxcore.Init()
    serve(LINE, LuxCore())
