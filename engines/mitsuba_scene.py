"""A scene that Mitsuba has loaded: its frame, its integrators by depth, its layers, and painting by `mitsuba.render`."""

import os

import mitsuba as mi
import numpy as np

from line_protocol import Refusal

LAYER_OF_TYPE = {"depth": ("depth", ["Z"]), "albedo": ("albedo", ["R", "G", "B"]),
                 "sh_normal": ("normal", ["X", "Y", "Z"]), "position": ("position", ["X", "Y", "Z"]),
                 "geo_normal": ("geometric_normal", ["X", "Y", "Z"]), "uv": ("uv", ["U", "V"])}


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
        self.margin = 0 if self.filter.is_box_filter() else int(np.ceil(self.filter.radius() - 0.5 - 1e-4))
        self.with_alpha = self._has_alpha(state, sensor_index)
        self.integrators = {}

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
            return self.scene.integrator()
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

    def channel_names(self):
        """Names of the further layers' channels, in the order in which the integrator gives them."""
        kinds = {}
        for tree in self._trees(self.integrator_tree or {}):
            for item in str(tree.get("aovs") or "").split(","):
                name, _, kind = item.strip().partition(":")
                kinds[name] = kind
        names, taken = [], set()
        for name in self.scene.integrator().aov_names():
            layer, _, channel = name.rpartition(".")
            known = LAYER_OF_TYPE.get(kinds.get(layer))
            if known:
                siblings = [other for other in self.scene.integrator().aov_names() if other.rpartition(".")[0] == layer]
                name = f"{known[0]}.{known[1][siblings.index(name)]}"
            elif not layer:
                name = f"{channel}.Y"
            if name in taken:
                name = f"{layer}.{channel}"
            taken.add(name)
            names.append(name)
        return names

    def _trees(self, tree):
        yield tree
        for value in tree.values():
            if isinstance(value, dict):
                yield from self._trees(value)

    def layers(self):
        return sorted({name.rpartition(".")[0] for name in self.channel_names()})

    def in_lanes(self, integrator):
        """Whether painting can be done by our own loop: for compiled variants, where samples go from the eye."""
        return (mi.variant().startswith(("llvm", "cuda")) and hasattr(integrator, "sample")
                and type(integrator).__module__.startswith("mitsuba.") and "_ad_" in mi.variant()
                and self.film.class_name() == "HDRFilm" and "polarized" not in mi.variant()
                and isinstance(integrator, mi.SamplingIntegrator))

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
            image = np.array(mi.render(self.scene, sensor=self.sensor, integrator=integrator, spp=asked, seed=seed))
            really = int(self.sensor.sampler().sample_count())
            total = image * really if total is None else total + image * really
            taken += really
            progress((index + 1) / passes)
        left, top = window.x0 - wide.x0, window.y0 - wide.y0
        mean = (total / taken)[top:top + window.height, left:left + window.width].astype(np.float32)
        names = ["R", "G", "B"] + (["A"] if self.with_alpha else []) + self.channel_names()
        if mean.shape[2] == 1:
            mean = np.repeat(mean, 3, axis=2)
        if mean.shape[2] != len(names):
            raise Refusal(f"Mitsuba gave {mean.shape[2]} channels where {len(names)} were expected: {', '.join(names)}")
        return {name: np.ascontiguousarray(mean[..., index]) for index, name in enumerate(names)}, taken
