# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: node trees become values of the renderer."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Callable

import bottega
import numpy as np

from .baked import PROPERTY
from .colors import ColorReader
from .context import Context
from .fields import Field, as_number, computed, constant, is_constant_of
from .nodes import CyclicNodes, Input, groups_of, named
from .report import Fidelity, Report
from .shaders import ShaderReader
from .surfaces import Model, Relief, Shader
from .textures import Pictures, flipped

# Reliefs dim light that grazes them, nearly as in Cycles.
_RULE = {"mitsuba": {"turns": True, "shadows": True, "mirrored": False}}
# Longest edge of a displaced mesh that is not refined.
_NO_EDGE = 1e15


@dataclass
class MadeMaterial:
    """A material, and what it needs.

    - `images`: images by key.
    - `uv_names`: the sets of texture coordinates that it uses, in the order of its `uv_set`s.
    - `color_name`: the color attribute that it uses; `None`: none.
    - `medium`: the medium of its inside.
    - `uses`: session numbers of its images and node groups. `is_moving`: one of its images is a sequence.
    - `asks`: what its values depend on: see `ColorReader`.
    """

    material: bottega.Material
    images: dict[str, Callable[[], bottega.Image]] = field(default_factory=dict)
    uv_names: list[str | None] = field(default_factory=list)
    color_name: str | None = None
    medium: bottega.Medium | None = None
    uses: set[Any] = field(default_factory=set)
    is_moving: bool = False
    asks: set[str] = field(default_factory=set)

    @property
    def looks(self) -> tuple[Any, ...]:
        """All that a picture depends on."""
        return replace_interior(self.material), self.medium, self.color_name


def replace_interior(material: bottega.Material) -> bottega.Material:
    """Returns a material without a medium inside, which has a key only in the scene."""
    return material if material.interior is None else replace(material, interior=None)


class MaterialMaker:
    """Makes the material of a node tree of Blender.

    - `owner`: name of the material, for the report; `key`: under which it is reported.
    - `context`: for what it is made. `uv_names`: the sets of texture coordinates of all materials of its family; it adds its own.
    """

    def __init__(
        self, pictures: Pictures, report: Report, key: str, owner: str, context: Context = Context(), uv_names: list[str | None] | None = None
    ) -> None:
        self.pictures, self.report, self.key, self.owner = pictures, report, key, owner
        self.made = MadeMaterial(bottega.Material(), uv_names=[] if uv_names is None else uv_names)
        self.reader = ColorReader(pictures, self.note, context)

    def note(self, node: Any, fidelity: Fidelity, text: str) -> None:
        """Adds a note about a node to the report."""
        self.report.add(self.key, self.owner, node if isinstance(node, str) else node.label or node.name, fidelity, text)

    def make(self, material: Any) -> MadeMaterial:
        """Makes a material. What cannot be rendered is in the report."""
        self.pictures.begin()
        self._read(material)
        self.made.uses |= self.pictures.used
        self.made.is_moving = self.pictures.is_moving
        self.made.asks = set(self.reader.asks)
        return self.made

    def _read(self, material: Any) -> None:
        tree = material.node_tree if getattr(material, "use_nodes", True) else None
        if tree is None:
            color = tuple(material.diffuse_color)[:3]
            self.made.material = bottega.Material(bottega.Diffuse(tuple(max(0.0, float(value)) for value in color)))
            return
        self.made.uses |= groups_of(tree)
        self.reader.material_index = float(material.pass_index)
        output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
        if output is None:
            self.note("Material Output", Fidelity.LEFT_OUT, "there is no output: the material is black")
            self.made.material = bottega.Material.matte(0.0)
            return
        self.reader.baked = {str(name): str(image) for name, image in dict(material.get(PROPERTY, {})).items()}
        try:
            shader = ShaderReader(self.reader).shader(named(output, (), "Surface"))
            self.made.material = self.material_of(shader, output)
            self._volume(output, shader)
            displacement = named(output, (), "Displacement")
            if displacement is not None and displacement.source() is not None:
                self._displacement(displacement, material)
        except CyclicNodes as error:
            self.note("Material Output", Fidelity.LEFT_OUT, f"{error}: the material is black")
            self.made.material = bottega.Material.matte(0.0)
        if self.reader.vertex_colors:
            self.made.color_name = self.reader.vertex_colors[0]

    def material_of(self, shader: Shader, output: Any) -> bottega.Material:
        """Returns the material of a shader."""
        fields: dict[str, Any] = {}
        if not is_constant_of(shader.opacity, 1.0):
            fields.update(opacity=self.number(shader.opacity, 0.0, 1.0), alpha="blend")
        emission = self.color(shader.emission, None)
        surface = self.surface(shader.model) if shader.model is not None else bottega.Diffuse(0.0)
        fields.update(emission=emission, relief=self._relief(shader.relief))
        linked = named(output, (), "Surface")
        if linked is not None and linked.source() is None and self._has_volume(output):
            # A volume without a surface.
            return bottega.Material(bottega.Null(), **fields)
        return bottega.Material(surface, **fields)

    def surface(self, model: Model) -> Any:
        """Returns the surface of a model."""
        members: dict[str, Any] = {}
        for name, value in model.fields.items():
            if isinstance(value, Model):
                members[name] = self.surface(value)
            elif isinstance(value, Field):
                highest = None if name == "radius" else 1.0
                members[name] = self.color(value, highest) if value.channels == 3 else self.number(value, 0.0, 1.0)
            elif name == "anisotropy":
                members[name] = bottega.Anisotropy(min(value[0], 1.0), value[1])
            elif name == "iridescence":
                members[name] = bottega.Iridescence(1.0, max(value[1], 1.0), (value[0], value[0]))
            else:
                members[name] = value
        return getattr(bottega, model.name)(**members)

    def color(self, field_: Field, highest: float | None) -> Any:
        """Returns a color or a texture; values below 0 and, if given, above `highest` are cut."""
        if field_.is_constant:
            values = np.clip(np.broadcast_to(field_.load(), (3,)), 0.0, highest)
            return tuple(float(value) for value in values)
        if field_.image is not None:
            factor = tuple(float(value) for value in np.broadcast_to(field_.factor, (3,)))
            return self._texture(field_.image, self._image_of(field_.image), field_, factor)
        cut = computed("cut", field_.channels, lambda values: np.clip(values, 0.0, highest), field_)
        return self._texture(cut.key(), folded(cut), cut, (1.0, 1.0, 1.0))

    def number(self, field_: Field, low: float, high: float) -> Any:
        """Returns a number or a channel of a texture; values are cut to the limits."""
        field_ = as_number(field_)
        if field_.is_constant:
            return min(max(field_.number(), low), high)
        if field_.image is not None and 0.0 <= field_.factor[0]:
            texture = self._texture(field_.image, self._image_of(field_.image), field_, field_.factor[0])
            texture.channel = field_.channel
            return texture
        cut = computed("cut", 1, lambda values: np.clip(values, low, high), field_)
        return self._texture(cut.key(), folded(cut), cut, 1.0)

    def _image_of(self, key: str) -> Callable[[], bottega.Image]:
        return lambda: self.pictures.loaded[key].to_image()

    def _texture(self, key: str, image: Callable[[], bottega.Image], field_: Field, factor: Any) -> bottega.Texture:
        placing = field_.placing
        assert placing is not None
        self.made.images[key] = image
        names = self.made.uv_names
        if placing.uv_name not in names:
            if len(names) == 2:
                self.note("UV Map", Fidelity.APPROXIMATED, f"the third set of coordinates, {placing.uv_name}, is rendered as the first")
            else:
                names.append(placing.uv_name)
        index = names.index(placing.uv_name) if placing.uv_name in names else 0
        wrap = (placing.wrap, placing.wrap)
        return bottega.Texture(key, factor, "r", index, flipped(placing.transform), wrap, placing.is_smooth)  # type: ignore[arg-type]

    def _relief(self, relief: Relief | None) -> Any:
        if relief is None:
            return None
        if relief.kind == "normal":
            texture = self.color(relief.field, None)
            return bottega.NormalMap(texture, relief.strength, _RULE) if isinstance(texture, bottega.Texture) else None
        low = computed("height", 1, lambda values: values, relief.field)
        return bottega.BumpMap(self._texture(low.key(), folded(low), low, 1.0), _RULE)

    def _displacement(self, displacement: Input, material: Any) -> None:
        source = displacement.source()
        assert source is not None
        method = getattr(material, "displacement_method", None) or getattr(getattr(material, "cycles", None), "displacement_method", "BUMP")
        moves = method in ("DISPLACEMENT", "BOTH")
        if source.node.bl_idname == "ShaderNodeVectorDisplacement" and moves:
            self._vector_displacement(source, "DISPLACEMENT")
            return
        if source.node.bl_idname != "ShaderNodeDisplacement":
            self.note(source.node, Fidelity.LEFT_OUT, "vector displacement is left out where the material only has bumps")
            return
        height = self.reader.at(source, "Height", 0.0)
        scale = self.reader.at(source, "Scale", 1.0)
        if height.is_constant or not scale.is_constant:
            self.note(source.node, Fidelity.LEFT_OUT, "a displacement that is the same everywhere is left out")
            return
        if moves:
            middle = self.reader.at(source, "Midlevel", 0.5)
            length = scale.number()
            low = computed("height", 1, lambda values: values, height)
            texture = self._texture(low.key(), folded(low), low, 1.0)
            self._move(source, method, texture, length, middle.number() if middle.is_constant else 0.5)
        if method == "DISPLACEMENT":
            return
        if self.made.material.relief is None:
            factor = scale.number()
            self.made.material.relief = self._relief(Relief("bump", computed("scale", 1, lambda h: h * factor, height)))

    def _vector_displacement(self, source: Any, method: str) -> None:
        scale = self.reader.at(source, "Scale", 1.0)
        middle = self.reader.at(source, "Midlevel", 0.0)
        vector = self.color(self.reader.color_at(source, "Vector"), None)
        if not isinstance(vector, bottega.Texture) or not scale.is_constant:
            self.note(source.node, Fidelity.LEFT_OUT, "a displacement that is the same everywhere is left out")
            return
        vectors = "tangent" if source.node.space == "TANGENT" else "object"
        self._move(source, method, vector, scale.number(), middle.number() if middle.is_constant else 0.0, vectors)

    def _move(self, source: Any, method: str, texture: bottega.Texture, scale: float, middle: float, vectors: Any = "none") -> None:
        """Lets a texture move the vertices of the material's meshes, which are not refined, as in Cycles. With a bump they keep their normals."""
        space = "world" if source.node.space == "WORLD" and vectors == "none" else "object"
        if source.node.space == "WORLD" and vectors != "none":
            self.note(source.node, Fidelity.APPROXIMATED, "vectors of the world are rendered as those of the object")
        self.made.material.displacement = bottega.Displacement(texture, scale, -scale * middle, vectors, space, _NO_EDGE, method == "BOTH")  # type: ignore[arg-type]

    def _has_volume(self, output: Any) -> bool:
        volume = named(output, (), "Volume")
        return volume is not None and volume.source() is not None

    def _volume(self, output: Any, shader: Shader) -> None:
        found = named(output, (), "Volume")
        source = found.source() if found is not None else None
        if source is None:
            return
        medium = medium_of(self.reader, source, self.note)
        if medium is not None:
            self.made.medium = medium


def medium_of(
    reader: ColorReader, source: Any, note: Callable[[Any, Fidelity, str], None], grid_factor: float | None = None, has_grid: bool = False
) -> bottega.Medium | None:
    """Returns the medium of a volume shader that is the same everywhere; `None`: there is none.

    - `has_grid`: it is multiplied by a grid. `grid_factor`: takes the place of the density; `None`: the shader's own counts.
    """
    node = source.node
    density = reader.at(source, "Density", 1.0) if grid_factor is None else constant(grid_factor)
    color = reader.color_at(source, "Color")
    if not density.is_constant or not color.is_constant:
        note(node, Fidelity.LEFT_OUT, "a volume that varies is left out")
        return None
    amount, tint = max(density.number(), 0.0), np.clip(color.load(), 0.0, 1.0)
    g = reader.at(source, "Anisotropy", 0.0)
    mean_cosine = min(max(g.number(), -0.999), 0.999) if g.is_constant else 0.0
    if node.bl_idname == "ShaderNodeVolumeAbsorption":
        return bottega.Medium(absorption=_tuple(amount * (1.0 - tint)))
    if node.bl_idname == "ShaderNodeVolumeScatter":
        if getattr(node, "phase", "HENYEY_GREENSTEIN") != "HENYEY_GREENSTEIN":
            note(node, Fidelity.APPROXIMATED, "the phase function is Henyey and Greenstein's")
        return bottega.Medium(scattering=_tuple(amount * tint), g=mean_cosine)
    if node.bl_idname == "ShaderNodeVolumePrincipled":
        absorbed = reader.color_at(source, "Absorption Color")
        dark = np.clip(absorbed.load(), 0.0, 1.0) if absorbed.is_constant else np.zeros(3, np.float32)
        # Cycles: absorption = density × (1 - color) × (1 - √absorption color).
        absorption = amount * np.maximum(1.0 - tint, 0.0) * np.maximum(1.0 - np.sqrt(dark), 0.0)
        strength = reader.at(source, "Emission Strength", 0.0)
        emission = reader.color_at(source, "Emission Color").load() * strength.number() if strength.is_constant else np.zeros(3)
        if not has_grid and named(node, source.groups, "Density Attribute") is not None and not is_constant_of(reader.at(source, "Blackbody Intensity"), 0.0):
            note(node, Fidelity.LEFT_OUT, "Blackbody Intensity is rendered as 0")
        return bottega.Medium(_tuple(absorption), _tuple(amount * tint), _tuple(np.broadcast_to(emission, (3,))), mean_cosine)
    note(node, Fidelity.LEFT_OUT, f"the volume {node.bl_label} is left out")
    return None


def _tuple(values: Any) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def folded(field_: Field) -> Callable[[], bottega.Image]:
    """Returns a function that makes the picture of a folded chain: numbers, row 0 on top."""

    def make() -> bottega.Image:
        values = np.asarray(field_.load(), np.float32)
        width, height = field_.size or (values.shape[1], values.shape[0])
        values = np.broadcast_to(values, (height, width, values.shape[-1]))[::-1]
        pixels = values[..., 0] if values.shape[-1] == 1 else values
        return bottega.Image(np.ascontiguousarray(pixels), "linear" if field_.channels == 3 else "data")

    return make
