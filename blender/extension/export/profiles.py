# SPDX-License-Identifier: GPL-3.0-or-later
"""Profiles of lamps (the node IES Texture) and pictures on lamps: values by direction."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any, Callable

import bottega
import bpy
import numpy as np

from .colors import ColorReader, Unsupported
from .fields import Field, Placing, cached, constant, scaled
from .nodes import Source, named
from .report import Fidelity
from .textures import NoPlace, flipped

# Watts of a lamp for a candela, as Cycles converts them: 4π over the lumens of a watt of D65.
WATTS = 0.0706650768394
# What Cycles returns for a file that it cannot read.
UNREADABLE = 100.0
# The texture coordinates of what a profile gives: those of its picture, by direction.
BY_PROFILE = "profile of a lamp"

# From the picture of a profile to the space of a lamp, by columns: straight down is −z; the left edge is −y, from where angles grow towards −x.
_LAMP_FROM_PROFILE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]])
# The same for a picture by latitude and longitude: the upper edge is +z, the middle +y, and columns grow towards −x.
_LAMP_FROM_PICTURE = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


class LampReader(ColorReader):
    """Reads values of the nodes of a lamp."""

    def _of(self, source: Source) -> Field:
        if source.node.bl_idname == "ShaderNodeTexIES":
            return self._profile(source)
        return super()._of(source)

    def _profile(self, source: Source) -> Field:
        node = source.node
        vector = named(node, source.groups, "Vector")
        feed = vector.source() if vector is not None else None
        if feed is not None:
            raise NoPlace(f"coordinates from the node {feed.node.bl_label} for a profile")
        strength = self.at(source, "Strength", 1.0)
        try:
            name, profile = _read(node)
        except (OSError, bottega.Error) as error:
            self.note(node, Fidelity.LEFT_OUT, f"{error}; as by Cycles, it is {UNREADABLE:g} everywhere")
            return scaled(constant(UNREADABLE), strength)
        if not strength.is_constant:
            raise Unsupported("a strength of a profile that varies is unknown to the renderer")
        factor = WATTS * profile.peak * strength.number()

        def load() -> Any:
            # Of fields the lowest row is the first
            return np.ascontiguousarray(profile.pixels("cubic")[::-1, :, None]) * np.float32(factor)

        values = cached(load)
        height, width = profile.pixels("cubic").shape
        return Field(f"{name} {factor:.9g}", 1, Placing(BY_PROFILE), values, size=(width, height))


def _read(node: Any) -> tuple[str, bottega.IesProfile]:
    """Returns the profile of a node, and a name that is another one for another profile."""
    if node.mode == "INTERNAL":
        if node.ies is None:
            raise OSError("no text is chosen")
        text, name = node.ies.as_string(), node.ies.name
    else:
        path = Path(bpy.path.abspath(node.filepath, library=node.id_data.library))
        text, name = path.read_bytes().decode("utf-8", "replace"), path.name
    digest = hashlib.sha256(text.encode("utf-8", "replace")).hexdigest()[:24]
    return f"profile {digest}", bottega.IesProfile.of_text(text, name)


class LampPicture:
    """The emission of a lamp by direction, or of a flat one by position: an image, and its orientation.

    - `key`: of the image in the scene; equal pictures share it. `image`: makes it.
    - `is_profile`: it is that of a profile. `lamp_from_picture`: (3, 3), from the space of the image to that of the lamp.
    """

    def __init__(self, emission: Field, cone: Callable[[Any], Any] | None = None, cone_name: str = "") -> None:
        """Makes the picture of a field. `cone`: returns a factor for cosines to the axis −z of the lamp."""
        assert emission.placing is not None
        self.is_profile = emission.placing.uv_name == BY_PROFILE
        self.lamp_from_picture = _LAMP_FROM_PROFILE if self.is_profile else _LAMP_FROM_PICTURE
        self._emission, self._cone = emission, cone
        digest = hashlib.sha256(f"{emission.name} {cone_name}".encode()).hexdigest()[:24]
        self.key = f"lamp {digest}"

    def texture(self) -> bottega.Texture:
        """Returns the texture of a flat lamp."""
        placing = self._emission.placing
        assert placing is not None
        return bottega.Texture(self.key, transform=flipped(placing.transform), wrap=(placing.wrap, placing.wrap), smooth=placing.is_smooth)  # type: ignore[arg-type]

    def image(self) -> bottega.Image:
        """Makes the image, row 0 on top."""
        values = np.maximum(np.asarray(self._emission.load(), np.float32), 0.0)[::-1]
        if self._cone is not None:
            # Only profiles have a cone or a spread: their upper row is the axis
            cosines = np.cos(np.linspace(0.0, np.pi, values.shape[0]))
            values = values * np.asarray(self._cone(cosines), np.float32)[:, None, None]
        pixels = values[..., 0] if values.shape[-1] == 1 else values
        return bottega.Image(np.ascontiguousarray(pixels, np.float32), "linear")


def along_axis(emission: Field) -> np.ndarray:
    """Returns the value of an emission by a profile at the axis −z of the lamp, (3,)."""
    # Of fields the last row is the uppermost; horizontally Cycles looks at 180°
    row = np.asarray(emission.load(), np.float64)[-1]
    return np.broadcast_to(row[row.shape[0] // 2], (3,)).astype(np.float64)
