# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes for numbers and colors."""

from __future__ import annotations

import hashlib
from typing import Any, Callable

import bpy
import numpy as np

from . import mixing
from .baked import name_of
from .context import LIGHT_PATH, ROUGHLY, Context
from .fields import CannotFold, Field, Placing, as_color, as_number, computed, constant, is_constant_of, scaled
from .images import MissingPicture
from .nodes import CyclicNodes, Input, Source, named
from .report import Fidelity
from .textures import NoPlace, Pictures, image_field

Note = Callable[[Any, Fidelity, str], None]


class Unsupported(Exception):
    """A node whose values are unknown here."""


class ColorReader:
    """Reads numbers and colors from inputs of nodes.

    - `note`: is called with a node and what is not exact.
    - `baked`: names of pictures that Cycles has baked, by what `baking.name_of` says of an input.
    - `bakeable`: inputs whose values are unknown here, and that could be baked.
    - `context`: the context in which they are read. `asks`: what was read of it: `ray`, and names of its values.
    - `material_index`: of the material that is read.
    - `vertex_colors`: names of the color attributes that were met; the renderer multiplies them to the color of a surface.
    """

    def __init__(self, pictures: Pictures, note: Note, context: Context = Context()) -> None:
        self.pictures, self.note, self.context = pictures, note, context
        self.asks: set[str] = set()
        self.material_index = 0.0
        self.vertex_colors: list[str] = []
        self.baked: dict[str, str] = {}
        self.bakeable: list[Any] = []
        self._made: dict[tuple[Any, ...], Field] = {}

    def number(self, found: Input | None, otherwise: float = 0.0) -> Field:
        """Returns the number of an input; `otherwise` where the node has no such input."""
        return as_number(self._field(found, constant(otherwise)))

    def color(self, found: Input | None, otherwise: float = 0.0) -> Field:
        """Returns the color of an input; a gray `otherwise` where the node has no such input."""
        return as_color(self._field(found, constant(otherwise, otherwise, otherwise)))

    def _field(self, found: Input | None, otherwise: Field) -> Field:
        if found is None:
            return otherwise
        source = found.source()
        if source is None:
            return _own(found.value(), otherwise)
        try:
            return self._of(source)
        except MissingPicture as error:
            self.note(source.node, Fidelity.LEFT_OUT, f"{error}: it is magenta")
            return constant(1.0, 0.0, 1.0)
        except (Unsupported, NoPlace, CannotFold) as error:
            baked = self._baked(found)
            if baked is not None:
                self.note(source.node, Fidelity.BAKED, "a picture that Cycles has baked is used")
                return baked
            if not found.groups:
                self.bakeable.append(found.socket)
            fallback = _own(getattr(found.socket, "default_value", None), otherwise)
            shown = ", ".join(f"{value:.3g}" for value in fallback.load())
            self.note(source.node, Fidelity.LEFT_OUT, f"{error}; the value of the input is used: {shown}")
            return fallback

    def _baked(self, found: Input) -> Field | None:
        """Returns the picture that was baked of what feeds an input, if it is still that; `None`: there is none."""
        name = None if found.groups else self.baked.get(name_of(found.socket))
        image = bpy.data.images.get(name) if name else None
        if image is None:
            return None
        try:
            key = self.pictures.read(image, None)
        except MissingPicture:
            return None
        pixels = self.pictures.loaded[key]
        height, width = pixels.array.shape[:2]
        return Field(f"{key} baked", 3, Placing(), lambda: pixels.linear()[..., :3], key, size=(width, height))

    def _of(self, source: Source) -> Field:
        key = (source.node, source.output.identifier, source.groups)
        if key not in self._made:
            self._made[key] = _guard  # A node that meets itself.
            try:
                reader = _READERS.get(source.node.bl_idname)
                if reader is None:
                    raise Unsupported(f"the node {source.node.bl_label} is unknown to the renderer")
                self._made[key] = reader(self, source)
            except BaseException:
                del self._made[key]
                raise
        if self._made[key] is _guard:
            raise CyclicNodes("the nodes feed themselves")
        return self._made[key]

    def at(self, source: Source, name: str, otherwise: float = 0.0) -> Field:
        """Returns the number of an input by name."""
        return self.number(named(source.node, source.groups, name), otherwise)

    def color_at(self, source: Source, *names: str) -> Field:
        """Returns the color of an input by name."""
        return self.color(named(source.node, source.groups, *names))


_guard = constant(0.0)


def _own(value: Any, otherwise: Field) -> Field:
    """Returns the value of an input that nothing feeds."""
    if value is None or isinstance(value, str):
        return otherwise
    if isinstance(value, (int, float)):
        return constant(float(value))
    members = [float(member) for member in value]
    return constant(*members[:3]) if len(members) >= 3 else constant(members[0])


def _image(reader: ColorReader, source: Source) -> Field:
    color, alpha, notes = image_field(source.node, source.groups, reader.pictures)
    for text in notes:
        reader.note(source.node, Fidelity.APPROXIMATED, text)
    return alpha if source.output.name == "Alpha" else color


def _rgb(reader: ColorReader, source: Source) -> Field:
    return constant(*tuple(source.node.outputs[0].default_value)[:3])


def _value(reader: ColorReader, source: Source) -> Field:
    return constant(source.node.outputs[0].default_value)


def _mix(reader: ColorReader, source: Source) -> Field:
    node, groups = source.node, source.groups
    is_new = node.bl_idname == "ShaderNodeMix"
    if not is_new:
        factor, a, b = (Input(node.inputs[index], groups) for index in range(3))
        mode, kind, clamps, clamps_factor = node.blend_type, "RGBA", node.use_clamp, True
    else:
        kind = node.data_type
        enabled = [socket for socket in node.inputs if socket.enabled]
        factor, a, b = (Input(socket, groups) for socket in enabled[:3])
        mode = node.blend_type if kind == "RGBA" else "MIX"
        clamps, clamps_factor = kind == "RGBA" and node.clamp_result, node.clamp_factor
    read = reader.number if kind == "FLOAT" else reader.color
    share = reader.number(factor)
    if clamps_factor:
        share = _clamped(share)
    first, second = read(a), read(b)
    if mode == "MULTIPLY" and is_constant_of(share, 1.0) and not clamps:
        return scaled(first, second)
    if is_constant_of(share, 0.0):
        return first
    if mode == "MIX" and is_constant_of(share, 1.0):
        return second
    if mixing.mix(mode, np.zeros(1), np.zeros(3), np.zeros(3)) is None:
        raise Unsupported(f"the blend mode {mode.lower()} is unknown to the renderer")
    mixed = computed(f"mix {mode}", first.channels, lambda f, x, y: mixing.mix(mode, f, x, y), share, first, second)
    return _clamped(mixed) if clamps else mixed


def _clamped(field: Field) -> Field:
    return computed("clamp", field.channels, lambda values: np.clip(values, 0.0, 1.0), field)


def _math(reader: ColorReader, source: Source) -> Field:
    node = source.node
    function = mixing.MATH.get(node.operation)
    if function is None:
        raise Unsupported(f"the operation {node.operation.lower()} is unknown to the renderer")
    inputs = [reader.number(Input(socket, source.groups)) for socket in node.inputs[:3]]
    inputs += [constant(0.0)] * (3 - len(inputs))
    made = computed(f"math {node.operation}", 1, function, *inputs)
    return _clamped(made) if node.use_clamp else made


def _vector_math(reader: ColorReader, source: Source) -> Field:
    node = source.node
    function = mixing.VECTOR_MATH.get(node.operation)
    if function is None:
        raise Unsupported(f"the operation {node.operation.lower()} is unknown to the renderer")
    vectors = [reader.color(Input(socket, source.groups)) for socket in node.inputs[:3]]
    return computed(f"vector {node.operation}", 3, function, *vectors, reader.at(source, "Scale", 1.0))


def _hue_saturation(reader: ColorReader, source: Source) -> Field:
    hue, saturation, value = (reader.at(source, name, 1.0) for name in ("Hue", "Saturation", "Value"))
    factor = reader.number(named(source.node, source.groups, "Fac", "Factor"), 1.0)
    # The node adds hue - 0.5; the formula adds hue + 0.5, which is the same turn.
    return computed("hsv", 3, mixing.hue_saturation, hue, saturation, value, factor, reader.color_at(source, "Color"))


def _bright_contrast(reader: ColorReader, source: Source) -> Field:
    bright = reader.number(named(source.node, source.groups, "Bright", "Brightness"))
    return computed("contrast", 3, mixing.bright_contrast, reader.color_at(source, "Color"), bright, reader.at(source, "Contrast"))


def _gamma(reader: ColorReader, source: Source) -> Field:
    def power(color: Any, gamma: Any) -> Any:
        return np.where(color > 0.0, np.maximum(color, 1e-30) ** gamma, color)

    return computed("gamma", 3, power, reader.color_at(source, "Color"), reader.at(source, "Gamma", 1.0))


def _invert(reader: ColorReader, source: Source) -> Field:
    factor = reader.number(named(source.node, source.groups, "Fac", "Factor"), 1.0)
    return computed("invert", 3, lambda f, color: color + f * (1.0 - 2.0 * color), factor, reader.color_at(source, "Color"))


def _ramp(reader: ColorReader, source: Source) -> Field:
    ramp = source.node.color_ramp
    count = 1025
    table = np.array([tuple(ramp.evaluate(index / (count - 1))) for index in range(count)], np.float32)
    columns = [3] if source.output.name == "Alpha" else [0, 1, 2]
    factor = reader.number(named(source.node, source.groups, "Fac", "Factor"))
    is_constant = ramp.interpolation == "CONSTANT"
    return computed(f"ramp {_digest(table)}", len(columns), lambda t: _looked_up(table[:, columns], t[..., 0], is_constant), factor)


def _digest(table: Any) -> str:
    return hashlib.sha256(table.tobytes()).hexdigest()


def _looked_up(table: Any, positions: Any, is_constant: bool) -> Any:
    """Returns the rows of a table at positions from 0 to 1, interpolated."""
    scaled_positions = np.clip(positions, 0.0, 1.0) * (len(table) - 1)
    low = np.floor(scaled_positions).astype(np.int64)
    if is_constant:
        return table[low]
    high = np.minimum(low + 1, len(table) - 1)
    share = (scaled_positions - low)[..., None].astype(np.float32)
    return table[low] + share * (table[high] - table[low])


def _curves(reader: ColorReader, source: Source) -> Field:
    mapping = source.node.mapping
    mapping.initialize()
    count = 257
    low, high = _curve_span(mapping)
    positions = np.linspace(low, high, count)
    together = _curve_values(mapping, 3, positions)
    # Blender applies the curve of a channel first, then the common one.
    tables = [np.interp(_curve_values(mapping, index, positions), positions, together) for index in range(3)]

    def apply(factor: Any, color: Any) -> Any:
        curved = np.stack([np.interp(color[..., index], positions, tables[index]) for index in range(3)], -1)
        return color + factor * (curved - color)

    name = "curves " + _digest(np.array(tables, np.float32))
    factor = reader.number(named(source.node, source.groups, "Fac", "Factor"), 1.0)
    return computed(name, 3, apply, factor, reader.color_at(source, "Color"))


def _curve_span(mapping: Any) -> tuple[float, float]:
    ends = [point.location[0] for curve in mapping.curves for point in curve.points]
    return min(0.0, *ends), max(1.0, *ends)


def _curve_values(mapping: Any, index: int, positions: Any) -> Any:
    curve = mapping.curves[index]
    return np.array([mapping.evaluate(curve, float(position)) for position in positions], np.float32)


def _float_curve(reader: ColorReader, source: Source) -> Field:
    mapping = source.node.mapping
    mapping.initialize()
    low, high = _curve_span(mapping)
    positions = np.linspace(low, high, 257)
    table = _curve_values(mapping, 0, positions)
    factor = reader.at(source, "Factor", 1.0)
    value = reader.at(source, "Value")
    name = "curve " + _digest(table)
    return computed(name, 1, lambda f, x: x + f * (np.interp(x, positions, table) - x), factor, value)


def _separate(reader: ColorReader, source: Source) -> Field:
    mode = getattr(source.node, "mode", "RGB")
    index = [output.identifier for output in source.node.outputs].index(source.output.identifier)
    color = reader.color(Input(source.node.inputs[0], source.groups))
    if mode == "RGB" and not color.is_constant and color.image is not None:
        # A channel of a picture stays the picture.
        load, factor = color.load, color.factor[min(index, len(color.factor) - 1)]
        return Field(f"{color.name}.{index}", 1, color.placing, lambda: load()[..., index : index + 1], color.image, "rgb"[index], (factor,), color.size)
    if mode == "HSV":
        return computed(f"hsv {index}", 1, lambda values: mixing.hsv_of_rgb(values)[..., index : index + 1], color)
    if mode == "HSL":
        raise Unsupported("HSL is unknown to the renderer")
    return computed(f"channel {index}", 1, lambda values: values[..., index : index + 1], color)


def _combine(reader: ColorReader, source: Source) -> Field:
    mode = getattr(source.node, "mode", "RGB")
    inputs = [reader.number(Input(socket, source.groups)) for socket in source.node.inputs[:3]]

    def join(*parts: Any) -> Any:
        joined = np.concatenate(np.broadcast_arrays(*parts), -1)
        return mixing.rgb_of_hsv(joined) if mode == "HSV" else joined

    if mode == "HSL":
        raise Unsupported("HSL is unknown to the renderer")
    return computed(f"combine {mode}", 3, join, *inputs)


def _to_gray(reader: ColorReader, source: Source) -> Field:
    return as_number(reader.color(Input(source.node.inputs[0], source.groups)))


def _map_range(reader: ColorReader, source: Source) -> Field:
    node = source.node
    if getattr(node, "data_type", "FLOAT") != "FLOAT":
        raise Unsupported("Map Range of vectors is unknown to the renderer")
    kind = node.interpolation_type
    pairs = (("Value", 1.0), ("From Min", 0.0), ("From Max", 1.0), ("To Min", 0.0), ("To Max", 1.0), ("Steps", 4.0))
    inputs = [reader.at(source, name, rest) for name, rest in pairs]
    made = computed(f"range {kind}", 1, lambda *values: mixing.map_range(kind, *values), *inputs)
    if not node.clamp or kind not in ("LINEAR", "STEPPED"):
        return made
    return computed("within", 1, lambda x, a, b: np.clip(x, np.minimum(a, b), np.maximum(a, b)), made, inputs[3], inputs[4])


def _clamp(reader: ColorReader, source: Source) -> Field:
    value, low, high = (reader.at(source, name, rest) for name, rest in (("Value", 1.0), ("Min", 0.0), ("Max", 1.0)))
    swaps = source.node.clamp_type == "RANGE"

    def clip(x: Any, a: Any, b: Any) -> Any:
        return np.clip(x, np.minimum(a, b), np.maximum(a, b)) if swaps else np.minimum(np.maximum(x, a), b)

    return computed(f"clamp {swaps}", 1, clip, value, low, high)


def _blackbody(reader: ColorReader, source: Source) -> Field:
    kelvin = reader.at(source, "Temperature", 6500.0)
    if not kelvin.is_constant:
        raise Unsupported("a temperature that varies is unknown to the renderer")
    return constant(*mixing.blackbody(kelvin.number()))


def _light_falloff(reader: ColorReader, source: Source) -> Field:
    if source.output.name != "Quadratic":
        reader.note(source.node, Fidelity.APPROXIMATED, f"{source.output.name.lower()} falloff is rendered as quadratic")
    elif not is_constant_of(reader.at(source, "Smooth", 0.0), 0.0):
        reader.note(source.node, Fidelity.APPROXIMATED, "the falloff near the light is not smoothed")
    return reader.at(source, "Strength", 100.0)


def _vertex_color(reader: ColorReader, source: Source) -> Field:
    node = source.node
    name = getattr(node, "layer_name", None) if node.bl_idname == "ShaderNodeVertexColor" else node.attribute_name
    if node.bl_idname == "ShaderNodeAttribute" and node.attribute_type != "GEOMETRY":
        return _object_attribute(reader, source)
    if source.output.name not in ("Color", "Vector"):
        raise Unsupported(f"the output {source.output.name} of a color attribute is unknown to the renderer")
    reader.vertex_colors.append(name or "")
    return constant(1.0, 1.0, 1.0)


def _constant_of(value: float, text: str) -> Callable[[ColorReader, Source], Field]:
    def read(reader: ColorReader, source: Source) -> Field:
        reader.note(source.node, Fidelity.APPROXIMATED, text)
        return constant(value)

    return read


def _fresnel(reader: ColorReader, source: Source) -> Field:
    ior = reader.at(source, "IOR", 1.45)
    reader.note(source.node, Fidelity.APPROXIMATED, "the value at a right angle is used at all angles")
    return computed("fresnel", 1, lambda eta: ((eta - 1.0) / (eta + 1.0)) ** 2, ior)


def _layer_weight(reader: ColorReader, source: Source) -> Field:
    blend = reader.at(source, "Blend", 0.5)
    reader.note(source.node, Fidelity.APPROXIMATED, "the mean over all angles is used")
    return computed("layer weight", 1, lambda b: np.clip(0.1 + 0.5 * b, 0.0, 1.0), blend)


def _light_path(reader: ColorReader, source: Source) -> Field:
    name = source.output.name
    if name not in LIGHT_PATH:
        reader.note(source.node, Fidelity.APPROXIMATED, f"{name} is rendered as 0")
        return constant(0.0)
    if name in ROUGHLY:
        reader.note(source.node, Fidelity.APPROXIMATED, f"{name} is not followed exactly: {ROUGHLY[name]}")
    reader.asks.add("ray")
    return constant(LIGHT_PATH[name].get(reader.context.ray, 0.0))


_OBJECT_INFO = {"Location": "location", "Color": "color", "Alpha": "color", "Object Index": "index", "Random": "random"}


def _object_info(reader: ColorReader, source: Source) -> Field:
    name = source.output.name
    if name == "Material Index":
        return constant(reader.material_index)
    r, g, b, alpha = _of_object(reader, source, _OBJECT_INFO[name])
    return constant(alpha) if name == "Alpha" else constant(r) if name in ("Object Index", "Random") else constant(r, g, b)


def _object_attribute(reader: ColorReader, source: Source) -> Field:
    node = source.node
    kind = {"OBJECT": "object", "INSTANCER": "instancer"}.get(node.attribute_type)
    if kind is None:
        raise Unsupported(f"the attribute {node.attribute_name} of a {node.attribute_type.lower().replace('_', ' ')} is unknown to the renderer")
    r, g, b, alpha = _of_object(reader, source, f"{kind} {node.attribute_name}")
    name = source.output.name
    return constant(alpha) if name == "Alpha" else constant((r + g + b) / 3.0) if name.startswith("Fac") else constant(r, g, b)


def _of_object(reader: ColorReader, source: Source, name: str) -> tuple[float, float, float, float]:
    """Returns a value of the object that has the material."""
    reader.asks.add(name)
    value = reader.context.value(name)
    if value is None:
        reader.note(source.node, Fidelity.APPROXIMATED, "the value 0 is used, because this has no object")
        return 0.0, 0.0, 0.0, 0.0
    return value


_READERS: dict[str, Callable[[ColorReader, Source], Field]] = {
    "ShaderNodeTexImage": _image,
    "ShaderNodeRGB": _rgb,
    "ShaderNodeValue": _value,
    "ShaderNodeMixRGB": _mix,
    "ShaderNodeMix": _mix,
    "ShaderNodeMath": _math,
    "ShaderNodeVectorMath": _vector_math,
    "ShaderNodeHueSaturation": _hue_saturation,
    "ShaderNodeBrightContrast": _bright_contrast,
    "ShaderNodeGamma": _gamma,
    "ShaderNodeInvert": _invert,
    "ShaderNodeValToRGB": _ramp,
    "ShaderNodeRGBCurve": _curves,
    "ShaderNodeFloatCurve": _float_curve,
    "ShaderNodeSeparateRGB": _separate,
    "ShaderNodeSeparateColor": _separate,
    "ShaderNodeSeparateXYZ": _separate,
    "ShaderNodeCombineRGB": _combine,
    "ShaderNodeCombineColor": _combine,
    "ShaderNodeCombineXYZ": _combine,
    "ShaderNodeRGBToBW": _to_gray,
    "ShaderNodeMapRange": _map_range,
    "ShaderNodeClamp": _clamp,
    "ShaderNodeBlackbody": _blackbody,
    "ShaderNodeLightFalloff": _light_falloff,
    "ShaderNodeVertexColor": _vertex_color,
    "ShaderNodeAttribute": _vertex_color,
    "ShaderNodeFresnel": _fresnel,
    "ShaderNodeLayerWeight": _layer_weight,
    "ShaderNodeLightPath": _light_path,
    "ShaderNodeObjectInfo": _object_info,
    "ShaderNodeNewGeometry": _constant_of(0.0, "the value 0 is used: of the front"),
}
