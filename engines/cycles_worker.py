"""The worker of Blender's Cycles (see line_protocol.py). It runs under `python3` with the module `bpy`, and within an
installed Blender: `blender -b --factory-startup -noaudio --python cycles_worker.py`. The scene stays in memory, and
with it Cycles' geometry ("persistent data"), so that a window costs little beside its samples. A file that is opened
again, for another frame or size, is not read again.

Scenes: `.blend`, with scripts off unless the request says `trust`; `.gltf` and `.glb` by Blender's importer.

`parameters` of `open`: `scene` and `camera` (names; default: the file's own), `missing_files` ("fail" or "ignore":
Cycles paints what it does not find in pink, and says nothing).
"""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from line_protocol import Line, Refusal, layers_of, serve, sorted_files

LINE = Line()

import plain_exr

LAYER_OF_PASS = {"Depth": "depth", "Normal": "normal", "Position": "position", "DiffCol": "albedo", "UV": "uv",
                 "Vector": "vector", "Mist": "mist", "Emit": "emission", "Env": "environment", "AO": "occlusion",
                 "IndexOB": "object_index", "IndexMA": "material_index", "Diffuse Color": "albedo",
                 "Object Index": "object_index", "Material Index": "material_index", "Emission": "emission",
                 "Environment": "environment", "Ambient Occlusion": "occlusion", "Denoising Albedo": "denoising_albedo",
                 "Denoising Normal": "denoising_normal", "Denoising Depth": "denoising_depth"}
# Denoisers of the whole picture look for `albedo` and `normal`: what Cycles made for them comes first.
PREFERRED = {"albedo": "Denoising Albedo"}
# What Cycles takes from the first sample of a pixel, and codes of things with their coverage (those begin with "Crypto").
PICKED = {"depth", "position", "object_index", "material_index"}
# Layers that are what bottega's own engine means by these names.
SHARED = {"normal"}


def mend_numpy():
    """Debian's Blender looks for NumPy beside the first Python of the search path, which may be another one than Debian's; and
    Debian 12 has an importer of glTF that uses a name which its NumPy has dropped."""
    try:
        import numpy
    except ImportError:
        sys.path.append("/usr/lib/python3/dist-packages")
        try:
            import numpy
        except ImportError:
            return
    if not hasattr(numpy, "bool"):
        numpy.bool = bool


def set_where_known(thing, **values):
    """Sets properties that this version of Blender has."""
    for name, value in values.items():
        if name in thing.bl_rna.properties:
            setattr(thing, name, value)


class Cycles:
    name = "cycles"

    def __init__(self):
        self.version = bpy.app.version_string
        self.progress = None
        self.request = None
        # Path, size, time and trust of the open file, and what requests change in its scenes, as the file has it.
        self.loaded = None
        self.own = {}
        self.view_camera = None
        # Old Blenders tell what they do on stdout only, newer ones through the handler only.
        LINE.watch_output(self._on_stats)
        bpy.app.handlers.render_stats.append(self._on_stats)

    def open(self, request):
        self.request = None
        self._load(request["scene"], bool(request.get("trust")))
        parameters = request.get("parameters") or {}
        scene = self._choose_scene(parameters, request.get("view"))
        if (parameters.get("missing_files") or "fail") == "fail":
            self._refuse_missing_files()
        self._prepare(scene, request)
        self.request = request
        if request.get("frame") is not None:
            scene.frame_set(int(request["frame"]))
        render = scene.render
        self.width = render.resolution_x * render.resolution_percentage // 100
        self.height = render.resolution_y * render.resolution_percentage // 100
        return {"width": self.width, "height": self.height, "first_frame": scene.frame_start,
                "last_frame": scene.frame_end, "frame": scene.frame_current, "layers": self._layers(),
                "camera": scene.camera is not None, "filter": self._filter()}

    def paint(self, order, path, progress):
        if self.loaded is None or self.loaded[0] != self.request["scene"]:
            self.open(self.request)
        scene = self.scene
        if scene.camera is None:
            raise Refusal("Error: Cannot render, no camera (the scene has none)")
        if order.frame is not None and order.frame != scene.frame_current:
            scene.frame_set(order.frame)
        self._set_quality(order)
        self._set_window(order.window)
        written = path[:-4] + ".cycles.exr"
        if os.path.exists(written):
            os.remove(written)
        scene.render.filepath = written
        self.progress = progress
        try:
            bpy.ops.render.render(write_still=True, scene=scene.name)
        finally:
            self.progress = None
        if not os.path.isfile(written):
            raise Refusal("Blender finished and wrote no picture; its log may say why")
        picture = plain_exr.read(written)
        os.remove(written)
        if (picture.width, picture.height) != (order.window.width, order.window.height):
            raise Refusal(f"Cycles painted {picture.width}x{picture.height} pixels instead of "
                          f"{order.window.width}x{order.window.height}")
        plain_exr.write(path, picture.width, picture.height, self._named(picture.channels))
        return order.window, order.samples

    def files(self, path):
        if self.loaded is None or self.loaded[0] != path:
            self._load(path, False)
        return sorted_files(referred_files(path))

    def _load(self, path, trust):
        """Opens a file. Afterwards nothing of an earlier request is left: of the same file what it changed is put back, another
        one is read."""
        stamp = os.stat(path)
        wanted = (path, stamp.st_size, stamp.st_mtime_ns, trust)
        if self.loaded == wanted:
            self._put_back()
            return
        self.loaded = self.view_camera = None
        kind = os.path.splitext(path)[1].lower()
        if kind == ".blend":
            bpy.context.preferences.filepaths.use_scripts_auto_execute = trust
            bpy.ops.wm.open_mainfile(filepath=path, load_ui=False, use_scripts=trust)
        elif kind in (".gltf", ".glb"):
            bpy.ops.wm.read_factory_settings(use_empty=True)
            if not hasattr(bpy.types, "IMPORT_SCENE_OT_gltf"):
                bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
            mend_numpy()
            # Lights in the units of emissive surfaces, as glTF has them: Blender's own way makes them 683 times darker.
            asked = {"filepath": path, "export_import_convert_lighting_mode": "COMPAT"}
            known = bpy.ops.import_scene.gltf.get_rna_type().properties
            bpy.ops.import_scene.gltf(**{name: value for name, value in asked.items() if name in known})
            # A glTF says nothing of these, and Blender's defaults make the picture darker: all of its light counts.
            set_where_known(bpy.context.scene.cycles, sample_clamp_direct=0.0, sample_clamp_indirect=0.0, blur_glossy=0.0,
                            light_sampling_threshold=0.0, caustics_reflective=True, caustics_refractive=True)
        else:
            raise Refusal(f"{path}: Blender is given .blend, .gltf and .glb files here")
        if self._on_stats not in bpy.app.handlers.render_stats:
            bpy.app.handlers.render_stats.append(self._on_stats)
        self.own = {scene.name: settings_of(scene) for scene in bpy.data.scenes}
        self.loaded = wanted

    def _put_back(self):
        """Gives the scenes of the open file the settings that the file has."""
        for scene in bpy.data.scenes:
            own = self.own[scene.name]
            if is_diced(scene):
                # What Cycles has kept was made for the size and the camera of before.
                scene.render.use_persistent_data = False
            scene.camera = own["camera"]
            for thing, values in ((scene.render, own["render"]), (scene.cycles, own["cycles"])):
                for name, value in values.items():
                    setattr(thing, name, value)
            for layer, is_used in zip(scene.view_layers, own["layers"]):
                layer.use = is_used
            if scene.frame_current != own["frame"]:
                scene.frame_set(own["frame"])
        if self.view_camera is not None:
            bpy.data.cameras.remove(self.view_camera.data)
            self.view_camera = None

    def _choose_scene(self, parameters, view):
        scene = bpy.context.scene
        if parameters.get("scene"):
            scene = bpy.data.scenes.get(parameters["scene"])
            if scene is None:
                raise Refusal(f"the file has no scene `{parameters['scene']}`; it has "
                              + ", ".join(bpy.data.scenes.keys()))
        if parameters.get("camera"):
            camera = scene.objects.get(parameters["camera"])
            if camera is None or camera.type != "CAMERA":
                raise Refusal(f"the scene has no camera `{parameters['camera']}`")
            scene.camera = camera
        elif scene.camera is None:
            scene.camera = next((thing for thing in scene.objects if thing.type == "CAMERA"), None)
        if scene.camera is None and view is not None:
            scene.camera = self.view_camera = self._camera_of(view)
            scene.collection.objects.link(scene.camera)
        self.scene = scene
        return scene

    def _camera_of(self, view):
        """A camera as bottega has it: y is up there, z in Blender."""
        lens = bpy.data.cameras.new("view")
        lens.sensor_fit = "VERTICAL"
        lens.angle = view["vertical_fov"]
        lens.clip_start, lens.clip_end = 1e-5, 1e9
        camera = bpy.data.objects.new("view", lens)
        columns = [view["world_from_camera"][start:start + 3] for start in range(0, 16, 4)]
        x, y, z = zip(*columns)
        last = (0.0, 0.0, 0.0, 1.0)
        camera.matrix_world = Matrix((x, tuple(-value for value in z), y, last))
        return camera

    def _filter(self):
        """How samples are spread over a pixel. Cycles' widths are of its own kind: see `filter_table` in its film.cpp."""
        kind, width = self.scene.cycles.pixel_filter_type, self.scene.cycles.filter_width
        if kind == "BLACKMAN_HARRIS":
            return {"kind": "blackman-harris", "radius": width}
        if kind == "GAUSSIAN":
            return {"kind": "gaussian", "radius": 1.5 * width, "sigma": width / 4}
        return {"kind": "box", "radius": 0.5}

    def _refuse_missing_files(self):
        missing = [path for path in used_files() if not os.path.isfile(path)]
        if missing:
            more = f" and {len(missing) - 5} more" if len(missing) > 5 else ""
            raise Refusal("cannot find " + ", ".join(missing[:5]) + more + " (Cycles would paint pink where these "
                          "belong; `missing_files=ignore` lets it)")

    def _prepare(self, scene, request):
        """What must be the same for all windows of a picture; the rest is as the file says."""
        render, cycles = scene.render, scene.cycles
        render.engine = "CYCLES"
        cycles.device = "CPU"
        render.threads_mode = "FIXED"
        render.threads = max(1, int(request.get("threads") or 1))
        if request.get("width") is not None:
            render.resolution_x, render.resolution_y = int(request["width"]), int(request["height"])
            render.resolution_percentage = 100
        # A window must not be treated by itself: no denoising, no samples spared by place, no compositor.
        set_where_known(cycles, use_adaptive_sampling=False, use_denoising=False, time_limit=0.0, use_auto_tile=False,
                        use_animated_seed=False, use_sample_subset=False, sample_offset=0)
        set_where_known(render, use_persistent_data=True, use_compositing=False, use_sequencer=False,
                        use_freestyle=False, use_multiview=False, use_stamp=False, use_overwrite=True,
                        use_placeholder=False, use_file_extension=False, use_render_cache=False)
        kept = next((layer for layer in scene.view_layers if layer.use), scene.view_layers[0])
        for layer in scene.view_layers:
            layer.use = layer == kept
        kept.samples = 0
        self.view_layer = kept
        output = render.image_settings
        set_where_known(output, media_type="MULTI_LAYER_IMAGE")
        output.file_format = "OPEN_EXR_MULTILAYER"
        set_where_known(output, color_depth="32", exr_codec="NONE", use_exr_interleave=True, use_preview=False)
        if "linear_colorspace_settings" in output.bl_rna.properties:
            try:
                output.linear_colorspace_settings.name = "Linear Rec.709"
            except TypeError:
                pass  # This version calls it otherwise, and has no other working space.

    def _set_quality(self, order):
        cycles = self.scene.cycles
        cycles.samples = order.samples
        # The same for all windows: with equal seeds a window has the bits of the full frame.
        cycles.seed = order.hashed_seed(31)
        own = self.own[self.scene.name]["cycles"]
        depth = order.max_depth
        for name in DEPTHS:
            value = own[name] if depth is None else depth
            if name == "volume_bounces" and depth is not None:
                value = min(own[name], depth)
            if getattr(cycles, name) != value:
                setattr(cycles, name, value)

    def _set_window(self, window):
        """Blender cuts `border * size` down to whole numbers; a quarter of a pixel keeps rounding from losing one."""
        render = self.scene.render
        render.use_border = True
        render.use_crop_to_border = True
        render.border_min_x = (window.x0 + 0.25) / self.width
        render.border_max_x = (window.x1 + 0.25) / self.width
        render.border_min_y = (self.height - window.y1 + 0.25) / self.height
        render.border_max_y = (self.height - window.y0 + 0.25) / self.height

    def _on_stats(self, *arguments):
        """Blender tells what it does in words: `… | Sample 12/64`."""
        text = next((word for word in arguments if isinstance(word, str)), "")
        if self.progress is None or "Sample " not in text:
            return
        done, _, of = text.rpartition("Sample ")[2].partition("/")
        try:
            self.progress(int(done) / int(of.split()[0]))
        except (ValueError, IndexError, ZeroDivisionError):
            pass

    def _layers(self):
        """The layers that a picture will have beside the color, by Cycles' own list of its passes."""
        from cycles.engine import list_render_passes
        passes = {name: channels for name, channels, _ in list_render_passes(self.scene, self.view_layer)}
        named = [f"{layer_of(kind, passes)}.{channel}" for kind, channels in passes.items() if kind != "Combined"
                 for channel in channels]
        picked = PICKED | {layer_of(kind, passes) for kind in passes if kind.startswith("Crypto")}
        return layers_of(named, picked=picked, shared=SHARED)

    def _named(self, channels):
        """Blender's `Layer.Pass.Channel` by the names of the protocol."""
        named = {}
        passes = {name.split(".", 1)[1].rpartition(".")[0] for name in channels if name.count(".") >= 2}
        for name, plane in channels.items():
            parts = name.split(".", 1)[1] if name.count(".") >= 2 else name
            kind, _, channel = parts.rpartition(".")
            if kind == "Combined" or not kind:
                if channel in "RGB" or (channel == "A" and self.scene.render.film_transparent):
                    named[channel] = plane
                continue
            named[f"{layer_of(kind, passes)}.{channel}"] = plane
        return named


def layer_of(kind, passes):
    """The protocol's name for the layer of a pass, where the picture has these passes."""
    layer = LAYER_OF_PASS.get(kind, kind.replace(" ", "_"))
    for better, made_by in PREFERRED.items():
        if made_by in passes and kind == made_by:
            return better
        if made_by in passes and layer == better:
            return kind.replace(" ", "_")
    return layer


DEPTHS = ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces", "volume_bounces")
SIZES = ("resolution_x", "resolution_y", "resolution_percentage")


def is_diced(scene):
    """True if the geometry depends on camera and size: adaptive subdivision."""
    if any(getattr(modifier, "use_adaptive_subdivision", False) for thing in scene.objects for modifier in thing.modifiers):
        return True
    return getattr(scene.cycles, "feature_set", "") == "EXPERIMENTAL" and any(
        getattr(getattr(thing, "cycles", None), "use_adaptive_subdivision", False) for thing in scene.objects)


def settings_of(scene):
    """What requests change in a scene: camera, size, depths, view layers, frame. The rest is the same for all requests."""
    return {"camera": scene.camera, "render": {name: getattr(scene.render, name) for name in SIZES},
            "cycles": {name: getattr(scene.cycles, name) for name in DEPTHS},
            "layers": [layer.use for layer in scene.view_layers], "frame": scene.frame_current}


def absolute(path, library=None):
    return os.path.normpath(bpy.path.abspath(path, library=library))


def files_of_image(image):
    """The files of an image: one, a tile each, or one a frame."""
    if image.source == "GENERATED" or image.source == "VIEWER" or image.packed_file or not image.filepath:
        return []
    path = absolute(image.filepath, image.library)
    if image.source == "TILED":
        return [path.replace("<UDIM>", str(tile.number)).replace("<UVTILE>", uv_tile(tile.number))
                for tile in image.tiles]
    if image.source == "SEQUENCE":
        return siblings(path) or [path]
    return [path]


def uv_tile(number):
    return f"u{(number - 1001) % 10 + 1}_v{(number - 1001) // 10 + 1}"


def siblings(path):
    """Files that differ from `path` in their last number only."""
    folder, name = os.path.split(path)
    stem, kind = os.path.splitext(name)
    start = stem.rstrip("0123456789")
    if start == stem or not os.path.isdir(folder):
        return []
    return [os.path.join(folder, other) for other in os.listdir(folder)
            if other.startswith(start) and other.endswith(kind) and other[len(start):len(other) - len(kind)].isdigit()]


def used_files():
    """What pictures are made of: images with users, libraries, volumes, caches of geometry."""
    found = []
    for image in bpy.data.images:
        if image.users > (1 if image.use_fake_user else 0):
            found += files_of_image(image)
    found += [absolute(library.filepath, library.parent.library if library.parent else None)
              if not os.path.isabs(bpy.path.abspath(library.filepath)) else absolute(library.filepath)
              for library in bpy.data.libraries if not library.packed_file]
    for group in ("volumes", "cache_files"):
        for thing in getattr(bpy.data, group, []):
            if thing.filepath and not getattr(thing, "packed_file", None):
                path = absolute(thing.filepath, thing.library)
                found += (siblings(path) or [path]) if getattr(thing, "is_sequence", False) else [path]
    return sorted(set(found))


def referred_files(path):
    """Everything outside of the file that it names: `used_files`, fonts, and folders of simulations beside it."""
    found = set(used_files())
    own = os.path.normpath(bpy.utils.resource_path("LOCAL"))
    if path.lower().endswith((".gltf", ".glb")):
        return found | gltf_files(path)
    for other in bpy.utils.blend_paths(absolute=True, packed=False, local=False):
        other = os.path.normpath(other)
        if os.path.isfile(other) and not other.startswith(own + os.sep):
            found.add(other)
    cache = os.path.join(os.path.dirname(path), "blendcache_" + os.path.splitext(os.path.basename(path))[0])
    for folder, _, names in os.walk(cache):
        found.update(os.path.join(folder, name) for name in names)
    return found - {path}


def gltf_files(path):
    """Buffers and images that a glTF names, read from its JSON: the importer keeps no names of buffers."""
    import json
    import struct
    import urllib.parse
    with open(path, "rb") as file:
        data = file.read()
    if data[:4] == b"glTF":
        size, = struct.unpack_from("<I", data, 12)
        data = data[20:20 + size]
    document = json.loads(data)
    folder = os.path.dirname(path)
    names = [item["uri"] for group in ("buffers", "images") for item in document.get(group, []) if item.get("uri")]
    return {os.path.join(folder, urllib.parse.unquote(name)) for name in names if not name.startswith("data:")}


if __name__ == "__main__":
    try:
        import bpy
        from mathutils import Matrix
    except ImportError as error:
        LINE.fail(f"Blender's module bpy is not installed for {sys.executable}: {error}", fatal=True)
        LINE.leave(1)
    serve(LINE, Cycles())
