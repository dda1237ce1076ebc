# SPDX-License-Identifier: GPL-3.0-or-later
"""The world: a color or a panorama, which may differ for what the camera sees and for what lights the scene."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Callable

import bottega
import bpy
import numpy as np

from .baked import PROPERTY, name_of
from .colors import ColorReader
from .context import BOUNCES, Context, visibility_for
from .fields import Field, Placing, cached
from .images import MissingPicture, is_known_space
from .materials import folded
from .nodes import CyclicNodes, Input, Source, named
from .report import Fidelity, Report
from .shaders import ShaderReader
from .textures import NoPlace, Pictures, mapping_matrix

KEY = "world"
_FROM_BLENDER = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], np.float64)
# Directions of Blender's panorama from directions of the environment: -z, its center column, to +x; +x to -y; +y to +z.
_PANORAMA = np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]], np.float64)
Images = dict[str, Callable[[], bottega.Image]]


@dataclass
class Backdrop:
    """What only the camera sees behind the scene. `rotation`: of a sphere that shows it, x y z w."""

    emission: Any
    rotation: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)


@dataclass
class Surroundings:
    """What surrounds the scene.

    - `environment`: seen and lighting; `None`: none. `images`: of it and of the backdrop, by key.
    - `lights`: by key: light from all sides, for some kinds of ray.
    - `backdrop`: covers the environment for the camera.
    """

    environment: bottega.Environment | None = None
    images: Images = field(default_factory=dict)
    lights: dict[str, bottega.Light] = field(default_factory=dict)
    backdrop: Backdrop | None = None


class WorldReader(ColorReader):
    """Reads colors that may lie on a panorama. `rotation`: (3, 3), from directions of the world to the panorama."""

    def __init__(self, pictures: Pictures, report: Report, owner: str, context: Context) -> None:
        super().__init__(pictures, lambda node, fidelity, text: report.add(KEY, owner, node.label or node.name, fidelity, text), context)
        self.rotation = np.eye(3)

    def _of(self, source: Source) -> Field:
        if source.node.bl_idname == "ShaderNodeTexEnvironment":
            return self._environment(source)
        return super()._of(source)

    def _environment(self, source: Source) -> Field:
        node = source.node
        if node.image is None:
            raise MissingPicture("no picture is chosen")
        if node.projection != "EQUIRECTANGULAR":
            raise NoPlace("a mirror ball is unknown to the renderer")
        if not is_known_space(node.image):
            self.note(node, Fidelity.APPROXIMATED, f"the color space {node.image.colorspace_settings.name} is read as sRGB")
        self.rotation = _rotation(named(node, source.groups, "Vector"))
        key = self.pictures.read(node.image, node.image_user)
        pixels = self.pictures.loaded[key]
        height, width = pixels.array.shape[:2]
        linear = cached(pixels.linear)
        return Field(f"{key} panorama", 3, Placing(), lambda: linear()[..., :3], key, size=(width, height))


def _rotation(vector: Input | None) -> np.ndarray:
    source = vector.source() if vector is not None else None
    if source is None:
        return np.eye(3)
    node = source.node
    if node.bl_idname == "ShaderNodeTexCoord" and source.output.name in ("Generated", "Normal", "Object"):
        return np.eye(3)
    if node.bl_idname == "ShaderNodeNewGeometry":
        return np.eye(3)
    if node.bl_idname == "ShaderNodeMapping":
        matrix = mapping_matrix(node, source.groups)[:3, :3]
        lengths = np.linalg.norm(matrix, axis=0)
        if lengths.max() - lengths.min() > 1e-3:
            raise NoPlace("a panorama that is stretched")
        return matrix / lengths.max() @ _rotation(named(node, source.groups, "Vector"))
    raise NoPlace(f"coordinates from the node {node.bl_label}")


@dataclass(frozen=True)
class _Sky:
    """The radiance of the world for a kind of ray, and the rotation of its panorama."""

    color: Field
    rotation: Any

    def is_like(self, other: _Sky) -> bool:
        """Returns true if it has the same values everywhere."""
        if self.color.is_constant and other.color.is_constant:
            return self.constant() == other.constant()
        return self.color.name == other.color.name and np.array_equal(self.rotation, other.rotation)

    def constant(self) -> tuple[float, ...]:
        """Returns the values of a constant."""
        return tuple(max(0.0, float(value)) for value in np.broadcast_to(self.color.load(), (3,)))


def surroundings_of(world: Any, pictures: Pictures, report: Report, is_clear: bool) -> Surroundings:
    """Returns what surrounds the scene. `is_clear`: the camera sees nothing of it (a film that is transparent)."""
    report.begin(KEY)
    if world is None:
        return Surroundings()
    shown = _rays_of(world, is_clear)
    tree = world.node_tree if getattr(world, "use_nodes", True) else None
    if tree is None:
        color = np.array(world.color)
        sky = _Sky(Field(f"color {tuple(color)}", 3, None, lambda: color), np.eye(3))
        return _surroundings({ray: sky for ray in ("camera", *BOUNCES)}, pictures, shown)
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    if output is None:
        return Surroundings()
    volume = named(output, (), "Volume")
    if volume is not None and volume.source() is not None:
        report.add(KEY, world.name, "Volume", Fidelity.LEFT_OUT, "a volume that fills the world is left out")
    try:
        skies = _skies(world, output, pictures, report)
    except CyclicNodes as error:
        report.add(KEY, world.name, "World Output", Fidelity.LEFT_OUT, f"{error}: the world is black")
        return Surroundings()
    return _surroundings(skies, pictures, shown)


def _rays_of(world: Any, is_clear: bool) -> list[str]:
    """Returns the kinds of ray that see the world."""
    settings = getattr(world, "cycles_visibility", None)
    names = {"volume": "scatter"}
    shown = [ray for ray in ("camera", *BOUNCES) if getattr(settings, names.get(ray, ray), True)]
    return [ray for ray in shown if not (is_clear and ray == "camera")]


def _skies(world: Any, output: Any, pictures: Pictures, report: Report) -> dict[str, _Sky]:
    """Returns the radiance of the world by kind of ray. Raises `CyclicNodes`."""
    surface = output.inputs["Surface"]
    kept = bpy.data.images.get(str(dict(world.get(PROPERTY, {})).get(name_of(surface)))) if PROPERTY in world else None
    baked = _baked(kept, pictures) if kept is not None else None
    skies: dict[str, _Sky] = {}
    for ray in ("camera", *BOUNCES):
        reader = WorldReader(pictures, Report() if baked else report, world.name, Context(ray))
        color = ShaderReader(reader).shader(named(output, (), "Surface")).emission
        skies[ray] = baked or _Sky(color, reader.rotation)
        if "ray" not in reader.asks:
            skies = {each: skies[ray] for each in ("camera", *BOUNCES)}
            break
        if baked is not None:
            text = "what the camera sees was baked, and lights the scene as well"
            report.add(KEY, world.name, "Light Path", Fidelity.APPROXIMATED, text)
    if baked is not None:
        report.add(KEY, world.name, "Surface", Fidelity.BAKED, "a panorama that Cycles has baked is used")
    bounces = [skies[ray] for ray in BOUNCES]
    if all(one.is_like(bounces[0]) for one in bounces):
        return skies
    if all(one.color.is_constant for one in bounces):
        text = "rough surfaces see the world of their kind of ray; Cycles takes that of no kind where it aims at lights"
        report.add(KEY, world.name, "Light Path", Fidelity.APPROXIMATED, text)
        return skies
    text = "a panorama that differs by kind of ray is for all rays but the camera's that of diffuse ones"
    report.add(KEY, world.name, "Light Path", Fidelity.APPROXIMATED, text)
    return {"camera": skies["camera"], **{ray: skies["diffuse"] for ray in BOUNCES}}


def _baked(image: Any, pictures: Pictures) -> _Sky:
    """Returns a panorama that Cycles has baked."""
    key = pictures.read(image, None)
    pixels = pictures.loaded[key]
    height, width = pixels.array.shape[:2]
    return _Sky(Field(f"{key} panorama", 3, Placing(), lambda: pixels.linear()[..., :3], key, size=(width, height)), np.eye(3))


def _surroundings(skies: dict[str, _Sky], pictures: Pictures, shown: list[str]) -> Surroundings:
    """Returns surroundings of the radiance by kind of ray. `shown`: the kinds of ray that see them."""
    made = Surroundings()
    lit = [ray for ray in BOUNCES if ray in shown]
    if not shown:
        return made
    lighting = skies[lit[0] if lit else "camera"]
    if all(skies[ray].is_like(lighting) for ray in shown):
        made.environment = _environment(lighting, pictures, made.images, shown)
        return made
    # A panorama lights the scene by importance; constants light it by two hemispheres, which have kinds of ray
    if not lighting.color.is_constant:
        made.environment = _environment(lighting, pictures, made.images, lit)
    else:
        by_color: dict[tuple[float, ...], list[str]] = {}
        for ray in lit:
            by_color.setdefault(skies[ray].constant(), []).append(ray)
        for color, rays in by_color.items():
            made.lights.update(_hemispheres(color, rays))
    if "camera" not in shown:
        return made
    seen = skies["camera"]
    if seen.color.is_constant and made.environment is None:
        made.lights.update(_hemispheres(seen.constant(), ["camera"]))
    else:
        made.backdrop = _backdrop(seen, pictures, made.images)
    return made


def _hemispheres(color: tuple[float, ...], rays: list[str]) -> dict[str, bottega.Light]:
    """Returns two suns, each as wide as a hemisphere, which have a radiance for some kinds of ray: by key."""
    if max(color) == 0.0:
        return {}
    irradiance = tuple(math.pi * value for value in color)
    visibility = visibility_for(rays)
    name = f"world {' '.join(rays)}"
    return {f"{name} {y:+g}": bottega.SunLight((0.0, y, 0.0), irradiance, 180.0, visibility) for y in (1.0, -1.0)}


def _environment(sky: _Sky, pictures: Pictures, images: Images, rays: list[str]) -> bottega.Environment | None:
    """Returns an environment for some kinds of ray, and adds its picture to `images`. `None`: it is black."""
    visibility = visibility_for([*rays, "shadow"])
    if sky.color.is_constant:
        color = sky.constant()
        return bottega.Environment(color, visibility=visibility) if max(color) > 0.0 else None
    key, factor = _picture(sky.color, pictures, images)
    return bottega.Environment(factor, key, rotation=_rows(_placed(sky)), visibility=visibility)


def _placed(sky: _Sky) -> np.ndarray:
    """Returns the rotation from the environment of a panorama to the world."""
    return _FROM_BLENDER @ sky.rotation.T @ _PANORAMA


def _picture(color: Field, pictures: Pictures, images: Images) -> tuple[str, tuple[float, ...]]:
    """Returns the key of a panorama, and its factor."""
    if color.image is not None:
        key = color.image
        images[key] = lambda: pictures.loaded[key].to_image()
        return key, tuple(float(value) for value in np.broadcast_to(color.factor, (3,)))
    color = replace(color, channels=3)
    images[color.key()] = folded(color)
    return color.key(), (1.0, 1.0, 1.0)


def _backdrop(sky: _Sky, pictures: Pictures, images: Images) -> Backdrop:
    """Returns what the camera sees on a sphere around the scene."""
    if sky.color.is_constant:
        return Backdrop(sky.constant())
    from mathutils import Matrix

    key, factor = _picture(sky.color, pictures, images)
    # Seen from within, u of a sphere runs against that of an environment, and begins half a turn away
    mirrored, rotation = -1.0, _placed(sky)
    if np.linalg.det(rotation) < 0.0:
        mirrored, rotation = 1.0, rotation @ np.diag((-1.0, 1.0, 1.0))
    turn = Matrix(_rows(rotation)).to_quaternion()
    transform = ((mirrored, 0.0, 0.5), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return Backdrop(bottega.Texture(key, factor, transform=transform, wrap=("repeat", "clamp")), (turn.x, turn.y, turn.z, turn.w))


def _rows(matrix: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(value) for value in row) for row in matrix)
