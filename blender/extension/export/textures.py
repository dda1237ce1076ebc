# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures on surfaces: which pixels, and where they lie."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .fields import IDENTITY, Field, Matrix3, Placing, cached
from .images import MissingPicture, Pixels, is_known_space, pixels_of
from .nodes import Input, named, uid_of

_WRAPS = {"REPEAT": "repeat", "EXTEND": "clamp", "CLIP": "clamp", "MIRROR": "mirror"}


class NoPlace(Exception):
    """Coordinates that are not texture coordinates of the mesh; the text names them."""


@dataclass
class Pictures:
    """The pictures of Blender that were read in this export, by key.

    - `loaded`: pixels by key.
    - `frame`: the frame of the scene, which decides what sequences show.
    - `revisions`: how often Blender has said that the pixels of an image have changed; part of its key.
    - `used`: session numbers of the images that were requested since `begin`. `is_moving`: one of them is a sequence.
    """

    loaded: dict[str, Pixels] = field(default_factory=dict)
    frame: int = 1
    revisions: dict[Any, int] = field(default_factory=dict)
    used: set[Any] = field(default_factory=set)
    is_moving: bool = False

    def begin(self) -> None:
        """Begins to note which images are used."""
        self.used, self.is_moving = set(), False

    def key_of(self, image: Any, frame: int = 0) -> str:
        """Returns the key of an image, or of a frame of it."""
        uid = uid_of(image)
        return f"image {uid} {self.revisions.get(uid, 0)} {frame} {image.colorspace_settings.name}"

    def changed(self, image: Any) -> None:
        """Notes that the pixels of an image have changed."""
        uid = uid_of(image)
        self.revisions[uid] = self.revisions.get(uid, 0) + 1

    def read(self, image: Any, user: Any) -> str:
        """Reads an image, unless it is there, and returns its key. Raises `MissingPicture`."""
        self.used.add(uid_of(image))
        self.is_moving |= image.source in ("SEQUENCE", "MOVIE")
        if image.source == "TILED":
            key = self.key_of(image)
            if key not in self.loaded:
                self.loaded[key] = _tiles(image)
            return key
        number = _frame_number(image, user, self.frame)
        key = self.key_of(image, number)
        if key not in self.loaded:
            self.loaded[key] = pixels_of(image) if number == 0 else _from_file(image, _frame_path(image, number))
        return key


    def framed(self, key: str) -> str:
        """Returns the key of an image with a transparent black frame, so wide that coarser mip levels have it, too."""
        framed = f"{key} framed"
        if framed not in self.loaded:
            pixels = self.loaded[key]
            height, width = (max(1, side // 16) for side in pixels.array.shape[:2])
            self.loaded[framed] = Pixels(np.pad(pixels.array, ((height, height), (width, width), (0, 0))), pixels.color_space)
        return framed


def _frame_number(image: Any, user: Any, frame: int) -> int:
    """Returns the number of the file of a sequence at a frame of the scene; 0: the image is not a sequence."""
    if image.source != "SEQUENCE" or user is None:
        return 0
    length = max(user.frame_duration, 1)
    position = frame - user.frame_start + 1
    position = (position - 1) % length + 1 if user.use_cyclic else min(max(position, 1), length)
    return position + user.frame_offset


def _frame_path(image: Any, number: int) -> Path:
    path = Path(image.filepath_from_user())
    digits = [index for index, character in enumerate(path.stem) if character.isdigit()]
    if not digits:
        raise MissingPicture(f"the file {path} of a sequence has no number")
    last = digits[-1]
    first = last
    while first - 1 in digits:
        first -= 1
    width = last - first + 1
    return path.with_name(f"{path.stem[:first]}{number:0{width}d}{path.stem[last + 1 :]}{path.suffix}")


def _from_file(image: Any, path: Path) -> Pixels:
    """Reads another file with the settings of an image."""
    import bpy

    if not path.is_file():
        raise MissingPicture(f"the file {path} is not there")
    other = bpy.data.images.load(str(path))
    try:
        other.colorspace_settings.name = image.colorspace_settings.name
        return pixels_of(other)
    finally:
        bpy.data.images.remove(other)


def tile_bounds(image: Any) -> tuple[int, int]:
    """Returns columns and rows of the grid of UDIM tiles."""
    numbers = [tile.number - 1001 for tile in image.tiles]
    return max(number % 10 for number in numbers) + 1, max(number // 10 for number in numbers) + 1


def _tiles(image: Any) -> Pixels:
    """Joins UDIM tiles to one picture; between them it is magenta, as in Cycles."""
    columns, rows = tile_bounds(image)
    pattern = image.filepath_from_user() if "<UDIM>" in image.filepath else image.filepath
    if "<UDIM>" not in pattern:
        import bpy

        pattern = bpy.path.abspath(image.filepath)
    read: dict[int, Pixels] = {}
    for tile in image.tiles:
        path = Path(image_path(image, pattern, tile.number))
        read[tile.number - 1001] = _from_file(image, path)
    width = max(pixels.array.shape[1] for pixels in read.values())
    height = max(pixels.array.shape[0] for pixels in read.values())
    first = next(iter(read.values()))
    full = 255 if first.array.dtype == np.uint8 else 1.0
    joined = np.full((rows * height, columns * width, 4), full, first.array.dtype)
    joined[..., 1] = 0
    for number, pixels in read.items():
        h, w = pixels.array.shape[:2]
        resized = pixels.array[np.arange(height)[:, None] * h // height, np.arange(width) * w // width]
        y, x = number // 10 * height, number % 10 * width
        joined[y : y + height, x : x + width] = resized
    return Pixels(joined, first.color_space)


def image_path(image: Any, pattern: str, number: int) -> str:
    """Returns the file of a UDIM tile."""
    import bpy

    u, v = (number - 1001) % 10 + 1, (number - 1001) // 10 + 1
    path = pattern.replace("<UDIM>", str(number)).replace("<UVTILE>", f"u{u}_v{v}")
    return bpy.path.abspath(path, library=image.library)


def image_field(node: Any, groups: tuple[Any, ...], pictures: Pictures) -> tuple[Field, Field, list[str]]:
    """Returns color and alpha of an Image Texture node, and what is not exact. Raises `NoPlace` and `MissingPicture`."""
    notes = []
    image = node.image
    if image is None:
        raise MissingPicture("no picture is chosen")
    if node.projection != "FLAT":
        raise NoPlace(f"the projection {node.projection.lower()}")
    key = pictures.read(image, node.image_user)
    if not is_known_space(image):
        notes.append(f"the color space {image.colorspace_settings.name} is read as sRGB")
    placing = placing_of(named(node, groups, "Vector"))
    transform = placing.transform
    if image.source == "TILED":
        columns, rows = tile_bounds(image)
        transform = _product(((1 / columns, 0, 0), (0, 1 / rows, 0), (0, 0, 1)), transform)
    elif node.extension == "CLIP":
        inner = pictures.loaded[key].array.shape
        key = pictures.framed(key)
        whole = pictures.loaded[key].array.shape
        across, up = inner[1] / whole[1], inner[0] / whole[0]
        transform = _product(((across, 0, 0.5 - 0.5 * across), (0, up, 0.5 - 0.5 * up), (0, 0, 1)), transform)
    placing = Placing(placing.uv_name, transform, _WRAPS[node.extension], node.interpolation != "Closest")
    pixels = pictures.loaded[key]
    height, width = pixels.array.shape[:2]
    linear = cached(pixels.linear)
    size = (width, height)
    color = Field(f"{key} {placing}", 3, placing, lambda: linear()[..., :3], key, size=size)
    alpha = Field(f"{key} alpha {placing}", 1, placing, lambda: linear()[..., 3:4], key, "a", size=size)
    return color, alpha, notes


def placing_of(vector: Input | None) -> Placing:
    """Returns where a picture lies whose coordinates come from an input. Raises `NoPlace`."""
    source = vector.source() if vector is not None else None
    if source is None:
        return Placing()
    node = source.node
    if node.bl_idname == "ShaderNodeUVMap":
        return Placing(node.uv_map or None)
    if node.bl_idname == "ShaderNodeTexCoord":
        if source.output.name == "UV":
            return Placing()
        raise NoPlace(f"the coordinates {source.output.name.lower()}")
    if node.bl_idname == "ShaderNodeAttribute" and node.attribute_type == "GEOMETRY":
        return Placing(node.attribute_name or None)
    if node.bl_idname == "ShaderNodeMapping":
        inner = placing_of(named(node, source.groups, "Vector"))
        return Placing(inner.uv_name, _product(_mapping(node, source.groups), inner.transform))
    raise NoPlace(f"coordinates from the node {node.bl_label}")


def mapping_matrix(node: Any, groups: tuple[Any, ...]) -> np.ndarray:
    """Returns the matrix of a Mapping node, (4, 4). Raises `NoPlace` if it varies."""
    from mathutils import Euler, Matrix

    values = {}
    for name, rest in (("Location", (0, 0, 0)), ("Rotation", (0, 0, 0)), ("Scale", (1, 1, 1))):
        found = named(node, groups, name)
        if found is not None and found.source() is not None:
            raise NoPlace(f"a Mapping node whose {name.lower()} varies")
        values[name] = tuple(found.value()) if found is not None else rest
    turn = Euler(values["Rotation"]).to_matrix().to_4x4()
    if node.vector_type in ("TEXTURE", "NORMAL"):
        inverse = [1 / value if value != 0 else 0.0 for value in values["Scale"]]
        matrix = Matrix.Diagonal((*inverse, 1.0)) @ turn.transposed()
        if node.vector_type == "TEXTURE":
            matrix = matrix @ Matrix.Translation(values["Location"]).inverted()
        else:
            matrix = turn @ Matrix.Diagonal((*inverse, 1.0))
    else:
        matrix = turn @ Matrix.Diagonal((*values["Scale"], 1.0))
        if node.vector_type == "POINT":
            matrix = Matrix.Translation(values["Location"]) @ matrix
    return np.array(matrix, np.float64)


def _mapping(node: Any, groups: tuple[Any, ...]) -> Matrix3:
    m = mapping_matrix(node, groups)
    return ((m[0, 0], m[0, 1], m[0, 3]), (m[1, 0], m[1, 1], m[1, 3]), (0.0, 0.0, 1.0))


def _product(a: Any, b: Any) -> Matrix3:
    if b == IDENTITY:
        return tuple(tuple(float(value) for value in row) for row in a)  # type: ignore[return-value]
    product = np.array(a, np.float64) @ np.array(b, np.float64)
    return tuple(tuple(float(value) for value in row) for row in product)  # type: ignore[return-value]


def flipped(transform: Matrix3) -> Matrix3:
    """Returns a transform between coordinates whose v runs downwards from one whose v runs upwards."""
    flip = np.array(((1, 0, 0), (0, -1, 1), (0, 0, 1)), np.float64)
    product = flip @ np.array(transform, np.float64) @ flip
    return tuple(tuple(float(value) for value in row) for row in product)  # type: ignore[return-value]
