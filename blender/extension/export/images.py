# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures: pixels of Blender's images, packed, generated and from files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bottega
import numpy as np

LINEAR = ("Linear Rec.709", "Linear", "scene_linear", "Scene Linear")
DATA = ("Non-Color", "Raw", "Generic Data")
# Linear Rec. 709 from other linear spaces.
_FROM_XYZ = np.array([[3.2404542, -1.5371385, -0.4985314], [-0.969266, 1.8760108, 0.041556], [0.0556434, -0.2040259, 1.0572252]])
_FROM_ACESCG = np.array([[1.7050510, -0.6217921, -0.0832589], [-0.1302564, 1.1408047, -0.0105483], [-0.0240034, -0.1289690, 1.1529724]])
_FROM_REC2020 = np.array([[1.6604910, -0.5876411, -0.0728499], [-0.1245505, 1.1328999, -0.0083494], [-0.0181508, -0.1005789, 1.1187297]])
MATRICES = {
    "Linear CIE-XYZ D65": _FROM_XYZ,
    "XYZ": _FROM_XYZ,
    "Linear ACEScg": _FROM_ACESCG,
    "ACEScg": _FROM_ACESCG,
    "Linear Rec.2020": _FROM_REC2020,
}


class MissingPicture(Exception):
    """A picture without pixels; the text says why."""


@dataclass(frozen=True)
class Pixels:
    """Pixels of an image; row 0 is the lowest.

    - `array`: uint8 or float32, (height, width, 4); alpha is not multiplied.
    - `color_space`: as in `bottega.Image`.
    """

    array: Any
    color_space: str

    def linear(self) -> Any:
        """Returns the pixels as float32, linear Rec. 709 or data, (height, width, 4)."""
        if self.array.dtype == np.float32:
            return self.array if self.color_space != "srgb" else _decoded(self.array)
        floats = self.array.astype(np.float32) / 255.0
        return _decoded(floats) if self.color_space == "srgb" else floats

    def to_image(self) -> bottega.Image:
        """Makes the image of a scene."""
        return bottega.Image(np.ascontiguousarray(self.array[::-1]), self.color_space)  # type: ignore[arg-type]


def _decoded(pixels: Any) -> Any:
    result = pixels.copy()
    color = result[..., :3]
    np.copyto(color, np.where(color <= 0.04045, color / 12.92, ((np.maximum(color, 0.0) + 0.055) / 1.055) ** 2.4))
    return result


def pixels_of(image: Any) -> Pixels:
    """Reads the pixels of an image of Blender, at its current frame. Raises `MissingPicture`."""
    width, height = image.size
    if image.source == "TILED":
        raise MissingPicture("an image of UDIM tiles is read tile by tile")
    if width == 0 or height == 0 or not image.has_data and len(image.pixels) == 0:
        where = image.filepath_from_user() or image.filepath
        lacks = "is not there" if where and not Path(where).is_file() and not image.packed_file else "cannot be read"
        raise MissingPicture(f"the file {where or image.name} {lacks}")
    channels = image.channels
    flat = np.empty(width * height * channels, np.float32)
    image.pixels.foreach_get(flat)
    array = flat.reshape(height, width, channels)
    if channels != 4:
        array = _with_four(array)
    space = image.colorspace_settings.name
    if not image.is_float:
        # In place: a large picture has hundreds of megabytes.
        array *= 255.0
        array += 0.5
        array = array.astype(np.uint8)
    elif not np.isfinite(array).all():
        array = np.nan_to_num(array, nan=0.0, posinf=65504.0, neginf=0.0)
    return _in_space(array, space, image.is_float)


def _with_four(array: Any) -> Any:
    height, width, channels = array.shape
    result = np.ones((height, width, 4), np.float32)
    result[..., :3] = array[..., :1] if channels < 3 else array[..., :3]
    if channels == 2:
        result[..., 3] = array[..., 1]
    return result


def _in_space(array: Any, space: str, is_float: bool) -> Pixels:
    if space in DATA:
        return Pixels(array, "data")
    # Blender converts float images to linear Rec. 709 when it loads them.
    if is_float or space in LINEAR:
        return Pixels(array, "linear")
    if space in MATRICES:
        floats = array.astype(np.float32) / 255.0
        floats[..., :3] = np.maximum(floats[..., :3] @ MATRICES[space].T.astype(np.float32), 0.0)
        return Pixels(floats, "linear")
    return Pixels(array, "srgb")


def is_known_space(image: Any) -> bool:
    """Returns true if the color space of an image is converted exactly."""
    space = image.colorspace_settings.name
    return image.is_float or space == "sRGB" or space in DATA or space in LINEAR or space in MATRICES
