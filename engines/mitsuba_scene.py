"""A scene that Mitsuba has loaded: its frame, its integrators by depth, its layers, and painting by `mitsuba.render`."""

import math
import os

import drjit as dr
import mitsuba as mi

from line_protocol import Refusal, layers_of
from planes import Sums, of_bitmap, scaled

LAYER_OF_TYPE = {"depth": ("depth", ["Z"]), "albedo": ("albedo", ["R", "G", "B"]),
                 "sh_normal": ("normal", ["X", "Y", "Z"]), "position": ("position", ["X", "Y", "Z"]),
                 "geo_normal": ("geometric_normal", ["X", "Y", "Z"]), "uv": ("uv", ["U", "V"])}
# Layers that are what bottega's own engine means by these names. Its albedo looks through mirrors and glass.
SHARED = ("depth", "normal")
# Layers that tell shapes and their triangles by numbers.
NUMBERS = ("shape_index", "prim_index")


def parse(path, variant, defines):
    """Mitsuba's own reader: (configuration, nodes). The scene's folder is where its files are looked for first."""
    resolver = mi.file_resolver()
    resolver.prepend(os.path.dirname(os.path.abspath(path)))
    config = mi.parser.ParserConfig(variant)
    values = dict(item.split("=", 1) for item in defines.split())
    return config, mi.parser.parse_file(config, path, **values)


def children(state, node, kind):
    """Indices of the nodes of a kind that stand in `node`."""
    resolved = mi.Properties.Type.ResolvedReference
    props = node.props
    for key in props.keys():
        if props.type(key) == resolved:
            index = props[key].index()
            if state.nodes[index].type == kind:
                yield index


def referred_files(path):
    """All files that the scene names: included scenes, meshes, textures, volumes, spectra. Missing ones are named as
    they would stand beside the scene."""
    _, state = parse(path, mi.variant(), "")
    folder = os.path.dirname(os.path.abspath(path))
    own = os.path.abspath(path)
    found = {os.path.abspath(str(file)) for file in state.files} - {own}
    for node in state.nodes:
        props = node.props
        for key in props.keys():
            if props.type(key) != mi.Properties.Type.String:
                continue
            value = props[key]
            place = str(mi.file_resolver().resolve(value))
            if os.path.isfile(place):
                found.add(os.path.abspath(place))
            elif key == "filename" or key.endswith("_filename"):
                found.add(os.path.join(folder, value))
    return found - {own}


class MitsubaScene:
    def __init__(self, request, variant, sensor_index, defines):
        path = request["scene"]
        config, state = parse(path, variant, defines)
        self._set_frame(state, sensor_index, request.get("width"), request.get("height"))
        self._read_integrator(state)
        self.with_alpha = self._has_alpha(state, sensor_index)
        self.pixel_filter = self._pixel_filter(state, sensor_index)
        kinds = self._kinds_of_layers()
        if any(kind in NUMBERS for kind in kinds.values()):
            # Mitsuba joins meshes of one material in an order that is another one in each process.
            config.merge_meshes = False
        mi.parser.transform_all(config, state)
        scene = mi.parser.instantiate(config, state)
        self.scene = scene[0] if isinstance(scene, list) else scene
        self.sensor = self.scene.sensors()[sensor_index]
        self.sensor_index = sensor_index
        self.film = self.sensor.film()
        self.film_size = tuple(int(n) for n in self.film.size())
        self.offset = tuple(int(n) for n in self.film.crop_offset())
        self.width, self.height = (int(n) for n in self.film.crop_size())
        # Sensors take places on the film relative to its crop: left, top, width, height.
        self.film_crop = (*self.offset, self.width, self.height)
        self.filter = self.film.rfilter()
        # The samples of a pixel reach so many pixels further than itself.
        self.margin = 0 if self.filter.is_box_filter() else math.ceil(self.filter.radius() - 0.5 - 1e-4)
        # Mitsuba itself refuses a scene that names none; what people mean is the path tracer.
        self.integrator = self.scene.integrator() or mi.load_dict({"type": "path"})
        self.integrators = {}
        self.layer_channels = self._layer_channels(kinds)
        self.numbers_shapes = [kinds.get(name.rpartition(".")[0]) == "shape_index" for name in self.layer_channels]
        self.number_of_shape = self._number_of_shape() if any(self.numbers_shapes) else None

    def _film_node(self, state, sensor_index):
        sensors = [node for node in state.nodes if node.type == mi.ObjectType.Sensor]
        if not sensors:
            raise Refusal("the scene has no sensor")
        if not 0 <= sensor_index < len(sensors):
            raise Refusal(f"the scene has {len(sensors)} sensors; there is none with index {sensor_index}")
        for index in children(state, sensors[sensor_index], mi.ObjectType.Film):
            return state.nodes[index]
        return None

    def _set_frame(self, state, sensor_index, width, height):
        """Changes the film to the size asked for. A film that crops keeps its crop, with the crop's size as the frame."""
        film = self._film_node(state, sensor_index)
        if width is None and height is None:
            return
        if film is None:
            raise Refusal("the scene's sensor has no film, so that it cannot be given another size")
        props = film.props
        old = {"width": props.get("width", 768), "height": props.get("height", 576)}
        for size, crop, offset, asked in (("width", "crop_width", "crop_offset_x", width),
                                          ("height", "crop_height", "crop_offset_y", height)):
            if asked is None:
                continue
            scale = asked / props.get(crop, old[size])
            if crop in props:
                props[offset] = round(props.get(offset, 0) * scale)
                props[crop] = int(asked)
            props[size] = max(round(old[size] * scale), int(asked) + props.get(offset, 0))

    def _has_alpha(self, state, sensor_index):
        film = self._film_node(state, sensor_index)
        text = film.props.get("pixel_format", "rgb") if film else "rgb"
        return text.lower().endswith("a") and text.lower() != "luma"

    def _pixel_filter(self, state, sensor_index):
        """How samples are spread over a pixel, by the protocol's names; None: in a way that it has no name for."""
        film = self._film_node(state, sensor_index)
        nodes = [state.nodes[index] for index in (children(state, film, mi.ObjectType.ReconstructionFilter) if film else [])]
        if not nodes:
            return {"kind": "gaussian", "radius": 2.0, "sigma": 0.5}
        kind, props = nodes[0].props.plugin_name(), nodes[0].props
        sigma = float(props.get("stddev", 0.5))
        known = {"box": {"kind": "box", "radius": float(props.get("radius", 0.5))},
                 "tent": {"kind": "tent", "radius": float(props.get("radius", 1.0))},
                 "gaussian": {"kind": "gaussian", "radius": 4 * sigma, "sigma": sigma},
                 "mitchell": {"kind": "mitchell", "radius": 2.0, "b": float(props.get("B", 1 / 3)),
                              "c": float(props.get("C", 1 / 3))},
                 "catmullrom": {"kind": "mitchell", "radius": 2.0, "b": 0.0, "c": 0.5}}
        return known.get(kind)

    def _read_integrator(self, state):
        """Keeps what the file says of the integrator, so that others of the same kind can be made with other depths."""
        roots = [node for node in state.nodes if node.type == mi.ObjectType.Integrator]
        nested = {index for node in roots for index in children(state, node, mi.ObjectType.Integrator)}
        self.integrator_tree = None
        for index, node in enumerate(state.nodes):
            if node.type == mi.ObjectType.Integrator and index not in nested:
                self.integrator_tree = self._tree(state, node)

    def _tree(self, state, node):
        kinds = mi.Properties.Type
        tree = {"type": node.props.plugin_name()}
        for key in node.props.keys():
            kind = node.props.type(key)
            if kind in (kinds.Bool, kinds.Integer, kinds.Float, kinds.String):
                tree[key] = node.props[key]
            elif kind == kinds.ResolvedReference:
                child = state.nodes[node.props[key].index()]
                name = child.props.id() or f"{key.strip('_')}"
                tree[name] = self._tree(state, child) if child.type == mi.ObjectType.Integrator else None
            else:
                tree[key] = None
        return tree

    def integrator_for(self, max_depth, light_samples):
        """The scene's integrator, or one of its kind with another depth. Bottega counts bounces after the direct
        light, Mitsuba edges of the path: 0 is 2."""
        if max_depth is None and light_samples is None:
            return self.integrator
        key = (max_depth, light_samples)
        if key not in self.integrators:
            tree = self.integrator_tree or {"type": "path"}
            self.integrators[key] = mi.load_dict(self._changed(tree, max_depth, light_samples))
        return self.integrators[key]

    def _changed(self, tree, max_depth, light_samples):
        if None in tree.values():
            raise Refusal(f"the scene's `{tree['type']}` integrator has parts that cannot be made again with another "
                          "depth; leave the depth to the scene")
        changed = {key: self._changed(value, max_depth, light_samples) if isinstance(value, dict) else value
                   for key, value in tree.items()}
        if tree["type"] in ("aov", "moment", "stokes", "depth"):
            return changed
        if tree["type"] == "direct":
            if light_samples is not None:
                changed.pop("shading_samples", None)
                changed["emitter_samples"] = light_samples
                changed.setdefault("bsdf_samples", 1)
            return changed
        if light_samples is not None:
            raise Refusal(f"Mitsuba's `{tree['type']}` integrator has no number of light samples; only `direct` has one")
        if max_depth is not None:
            changed["max_depth"] = max_depth + 2
        return changed

    def _number_of_shape(self):
        """Each shape's place in the file, from 1, by the number that Mitsuba gives it, which is another one in each
        process. Shapes in groups count as one that comes after all others. Only compiled variants have such numbers."""
        if not mi.variant().startswith(("llvm", "cuda")):
            return None
        given = [int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0]) for shape in self.scene.shapes()]
        table = [float(len(given) + 1)] * (max(given, default=0) + 1)
        table[0] = 0.0
        for place, number in enumerate(given, 1):
            table[number] = float(place)
        return mi.Float(table)

    def numbered(self, number):
        """The places of shapes in the file, by Mitsuba's numbers of them."""
        last = dr.width(self.number_of_shape) - 1
        inside = dr.gather(mi.Float, self.number_of_shape, mi.UInt32(dr.minimum(number, last)))
        return dr.select(number <= last, inside, len(self.scene.shapes()) + 1)

    def _kinds_of_layers(self):
        """What the `aov` integrators of the scene call their layers: kind by name."""
        kinds = {}
        for tree in self._trees(self.integrator_tree or {}):
            for item in str(tree.get("aovs") or "").split(","):
                name, _, kind = item.strip().partition(":")
                kinds[name] = kind
        return kinds

    def _layer_channels(self, kinds):
        """Our name of each channel that the integrator gives beside the color, by Mitsuba's name, in Mitsuba's order.
        None: the `aov` integrator gives the color of the first integrator in it once more."""
        nested = any(tree.get("type") == "aov" and any(isinstance(part, dict) for part in tree.values())
                     for tree in self._trees(self.integrator_tree or {}))
        given = list(self.integrator.aov_names())
        again = [name.rpartition(".")[0] for name in given[:4]]
        names = {}
        for index, name in enumerate(given):
            layer, _, channel = name.rpartition(".")
            if nested and index < 4 and layer == again[0] and layer not in kinds:
                names[name] = None
                continue
            better = name if layer else f"{channel}.Y"
            if kinds.get(layer) in LAYER_OF_TYPE:
                known, channels = LAYER_OF_TYPE[kinds[layer]]
                place = [other for other in given if other.rpartition(".")[0] == layer].index(name)
                better = f"{known}.{channels[place]}"
            names[name] = name if better in names.values() else better
        return names

    def _trees(self, tree):
        yield tree
        for value in tree.values():
            if isinstance(value, dict):
                yield from self._trees(value)

    def layers(self):
        """Mitsuba's film averages all of them, numbers too."""
        return layers_of([name for name in self.layer_channels.values() if name], shared=SHARED)

    def in_lanes(self, integrator):
        """Whether our own loop can paint: a compiled variant, a plain film, and integrators written in C++, whose
        `sample` follows a ray (those in Python take other arguments, those that start at lights have none)."""
        written_in_python = any(str(tree.get("type")).startswith(("prb", "direct_projective", "volprim"))
                                for tree in self._trees(self.integrator_tree or {}))
        return (mi.variant().startswith(("llvm", "cuda")) and "polarized" not in mi.variant()
                and self.film.class_name() == "HDRFilm" and not written_in_python
                and type(integrator).__module__ == "mitsuba" and isinstance(integrator, mi.SamplingIntegrator))

    def paint_by_render(self, integrator, order, passes, progress):
        """`mitsuba.render` of the window and the margin of the filter, in a few passes. -> (channels, samples)."""
        window = order.window
        wide = window.grown(self.margin, self.width, self.height)
        film = mi.traverse(self.sensor)
        film["film.crop_size"] = (wide.width, wide.height)
        film["film.crop_offset"] = (wide.x0 + self.offset[0], wide.y0 + self.offset[1])
        film.update()
        total, taken = None, 0
        passes = min(passes, order.samples)
        for index in range(passes):
            asked = order.samples * (index + 1) // passes - order.samples * index // passes
            seed = order.hashed_seed(31, "pass", index, *window.as_list())
            mi.render(self.scene, sensor=self.sensor, integrator=integrator, spp=asked, seed=seed)
            bitmap = self.film.bitmap()
            planes = of_bitmap(bitmap)
            really = int(self.sensor.sampler().sample_count())
            total = total or Sums(len(planes), wide.height, wide.width)
            for plane, values in enumerate(planes):
                total.add(plane, scaled(values, really), wide.height)
            taken += really
            progress((index + 1) / passes)
        left, top = window.x0 - wide.x0, window.y0 - wide.y0
        place = (left, top, left + window.width, top + window.height)
        given = [field.name for field in bitmap.struct_()]
        return self._named([total.means(plane, *place, weight=taken) for plane in range(len(given))], given), taken

    def _named(self, planes, given):
        """Channels of a bitmap by our names. A film of luminance becomes one of grey."""
        channels = {}
        for index, name in enumerate(given):
            name = self.layer_channels.get(name, name)
            if name is not None:
                channels[name] = planes[index]
        if "Y" in channels:
            channels.update(R=channels["Y"], G=channels["Y"], B=channels.pop("Y"))
        if not {"R", "G", "B"} <= channels.keys():
            raise Refusal(f"the scene's film gives no colors that can be told apart: {', '.join(given)}")
        return channels
