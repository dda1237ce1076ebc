# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair: curves of objects and of particle systems, and the node for their surface."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import bottega
import numpy as np

from .colors import ColorReader
from .fields import is_constant_of, luminance
from .meshes import Shape
from .nodes import Source
from .report import Fidelity
from .surfaces import Model, Shader

Array = Any

# Half the width of hair curves without an attribute `radius`.
RADIUS = 0.005
# Pieces of a smooth curve; curves of more points are divided less.
PIECES = 16
MOST_PIECES_PER_SEGMENT = 4
# Hairs of a particle system that are looked at to see whether it changes its shape.
LOOKED_AT = 16
# Absorption of the two pigments in hair, as in Cycles: R G B.
EUMELANIN = (0.506, 0.841, 1.653)
PHEOMELANIN = (0.343, 0.733, 1.924)


@dataclass
class Strands:
    """Curves, one after another. `points`: float32, (P, 3), in object space. `counts`: int32, (K,). `radii`: float32, (P,)."""

    points: Array
    counts: Array
    radii: Array

    def to_curves(self, material: str) -> bottega.Curves:
        """Makes the curves with the key of a material."""
        return bottega.Curves(self.points, self.counts, self.radii, material=material, drop_empty=True)


def strands_of_curves(data: Any) -> Strands | None:
    """Reads hair curves of Blender. Returns `None` if there is none."""
    count = len(data.points)
    points, counts = np.empty(3 * count, np.float32), np.empty(len(data.curves), np.int32)
    if count == 0:
        return None
    data.attributes["position"].data.foreach_get("vector", points)
    data.curves.foreach_get("points_length", counts)
    radii = np.full(count, RADIUS, np.float32)
    attribute = data.attributes.get("radius")
    if attribute is not None and attribute.domain == "POINT":
        attribute.data.foreach_get("value", radii)
    return _smooth(points.reshape(-1, 3), counts, radii)


def strands_of_particles(item: Any, system: Any, is_viewport: bool) -> Strands | None:
    """Reads the hair of an evaluated particle system, as Blender renders it. Returns `None` if there is none."""
    settings = system.settings
    steps = 2 ** (settings.display_step if is_viewport else settings.render_step) + 1
    parents, children = len(system.particles), len(system.child_particles)
    # Parents are seen only without children.
    first = parents if settings.child_type != "NONE" and children > 0 else 0
    strands = range(first, parents + children)
    world = [system.co_hair(item, particle_no=strand, step=step) for strand in strands for step in range(steps)]
    if not world:
        return None
    points = np.array([tuple(place) for place in world], np.float64).reshape(len(strands), steps, 3)
    inverse = np.linalg.inv(np.array(item.matrix_world, np.float64))
    points = points @ inverse[:3, :3].T + inverse[:3, 3]
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=2)
    along = np.concatenate((np.zeros((len(strands), 1)), np.cumsum(lengths, axis=1)), axis=1)
    total = along[:, -1:]
    share = np.divide(along, total, out=np.zeros_like(along), where=total > 0.0)
    radii = settings.radius_scale * 0.5 * _shaped(settings, share)
    if settings.use_close_tip:
        radii[:, -1] = 0.0
    counts = np.full(len(strands), steps, np.int32)
    return _smooth(points.reshape(-1, 3).astype(np.float32), counts, radii.ravel().astype(np.float32))


def shape_of_hair(kind: str, item: Any, data: Any) -> Shape:
    """Copies points by which a change of the shape can be seen: all of hair curves, some of a particle system, (P, 3)."""
    if kind == "CURVES":
        points = np.empty(3 * len(data.points), np.float32)
        if len(points) > 0:
            data.attributes["position"].data.foreach_get("vector", points)
        return Shape(points.reshape(-1, 3))
    last = 2**data.settings.render_step
    count = min(len(data.particles) + len(data.child_particles), LOOKED_AT)
    world = [tuple(data.co_hair(item, particle_no=strand, step=step)) for strand in range(count) for step in (0, last)]
    inverse = np.linalg.inv(np.array(item.matrix_world, np.float64))
    points = np.array(world, np.float64).reshape(-1, 3) @ inverse[:3, :3].T + inverse[:3, 3]
    # Rounding is no change.
    return Shape(np.round(points, 4).astype(np.float32))


def _shaped(settings: Any, share: Array) -> Array:
    """Returns the radius along a hair, before its scale. `share`: from the root, 0, to the tip, 1."""
    rest, shape = 1.0 - share, settings.shape
    if shape < 0.0:
        rest = rest ** (1.0 + shape)
    elif shape > 0.0:
        rest = rest ** (1.0 / (1.0 - min(shape, 0.999)))
    return rest * (settings.root_radius - settings.tip_radius) + settings.tip_radius


def _smooth(points: Array, counts: Array, radii: Array) -> Strands | None:
    """Divides curves into short straight pieces along Catmull-Rom splines, as Cycles sees them. Curves of one point are left out."""
    starts = np.concatenate(([0], np.cumsum(counts)[:-1])).astype(np.int64)
    good = np.isfinite(points).all(axis=1) & np.isfinite(radii)
    values = np.concatenate((points, np.maximum(radii, 0.0)[:, None]), axis=1)
    made, lengths = [], []
    for count in np.unique(counts[counts > 1]):
        rows = starts[counts == count][:, None] + np.arange(count)
        rows = rows[good[rows].all(axis=1)]
        pieces = int(np.clip(round(PIECES / (count - 1)), 1, MOST_PIECES_PER_SEGMENT))
        made.append(_spline(values[rows], pieces).reshape(-1, 4))
        lengths.append(np.full(len(rows), (count - 1) * pieces + 1, np.int32))
    if sum(map(len, lengths)) == 0:
        return None
    every = np.concatenate(made).astype(np.float32)
    return Strands(np.ascontiguousarray(every[:, :3]), np.concatenate(lengths), np.maximum(np.ascontiguousarray(every[:, 3]), 0.0))


def _spline(values: Array, pieces: int) -> Array:
    """Returns values on splines, (K, (N - 1) pieces + 1, 4), of (K, N, 4)."""
    if pieces == 1:
        return values
    count = values.shape[1]
    here = np.arange(count - 1)
    a, b, c, d = (values[:, np.clip(here + offset, 0, count - 1)] for offset in (-1, 0, 1, 2))
    parts = []
    for piece in range(pieces):
        t = piece / pieces
        weights = (
            0.5 * (-t + 2 * t**2 - t**3),
            0.5 * (2 - 5 * t**2 + 3 * t**3),
            0.5 * (t + 4 * t**2 - 3 * t**3),
            0.5 * (t**3 - t**2),
        )
        parts.append(sum(weight * one for weight, one in zip(weights, (a, b, c, d))))
    inner = np.stack(parts, axis=2).reshape(len(values), -1, values.shape[2])
    return np.concatenate((inner, values[:, -1:]), axis=1)


def hair_shader(reader: ColorReader, source: Source, note: Any) -> Shader:
    """Returns the shader of a Principled Hair node."""
    node = source.node
    if getattr(node, "model", "CHIANG") != "CHIANG":
        note(node, Fidelity.APPROXIMATED, "Huang's model is rendered as Chiang's")
    for name in ("Random Color", "Random Roughness"):
        if not is_constant_of(reader.at(source, name, 0.0), 0.0):
            note(node, Fidelity.APPROXIMATED, f"{name.lower()} is rendered as 0")
    if not is_constant_of(reader.at(source, "Coat", 0.0), 0.0):
        note(node, Fidelity.APPROXIMATED, "the coat is rendered as 0")
    beta_m, beta_n = reader.at(source, "Roughness", 0.3), reader.at(source, "Radial Roughness", 0.3)
    fields: dict[str, Any] = {"beta_m": beta_m, "beta_n": beta_n}
    for member, name, otherwise in (("eta", "IOR", 1.55), ("alpha", "Offset", math.radians(2.0))):
        value = reader.at(source, name, otherwise)
        if not value.is_constant:
            note(node, Fidelity.APPROXIMATED, f"{name} that varies is rendered as {otherwise:.3g}")
        fields[member] = value.number() if value.is_constant else otherwise
    fields["alpha"] = min(max(math.degrees(fields["alpha"]), -90.0), 90.0)
    fields["eta"] = max(fields["eta"], 1e-3)
    if node.parametrization == "COLOR":
        return Shader(Model("Hair", {**fields, "reflectance": reader.color_at(source, "Color")}))
    radial = beta_n.number() if beta_n.is_constant else 0.3
    return Shader(Model("Hair", {**fields, "sigma_a": _absorption(reader, source, note, radial)}))


def _absorption(reader: ColorReader, source: Source, note: Any, radial: float) -> tuple[float, ...]:
    """Returns the absorption in a hair, R G B, for the parametrizations by coefficients and by melanin."""

    def color(name: str) -> Array:
        field = reader.color_at(source, name)
        if not field.is_constant:
            note(source.node, Fidelity.APPROXIMATED, f"{name} that varies is rendered by its mean")
        return np.broadcast_to(np.asarray(field.load(), np.float64).reshape(-1, field.channels).mean(axis=0), (3,))

    def number(name: str, otherwise: float) -> float:
        field = reader.at(source, name, otherwise)
        if not field.is_constant:
            note(source.node, Fidelity.APPROXIMATED, f"{name} that varies is rendered by its mean")
        values = np.asarray(field.load(), np.float64)
        return float((luminance(values) if values.shape[-1] == 3 else values).mean())

    if source.node.parametrization == "ABSORPTION":
        return tuple(float(max(value, 0.0)) for value in color("Absorption Coefficient"))
    melanin = -math.log(max(1.0 - min(max(number("Melanin", 0.8), 0.0), 1.0), 1e-4))
    redness = min(max(number("Melanin Redness", 1.0), 0.0), 1.0)
    pigments = melanin * (1.0 - redness) * np.array(EUMELANIN) + melanin * redness * np.array(PHEOMELANIN)
    tint = np.clip(color("Tint"), 1e-5, 1.0)
    # The absorption of many hairs of a color (Chiang et al. 2016, eq. 9)
    width = 5.969 - 0.215 * radial + 2.532 * radial**2 - 10.73 * radial**3 + 5.574 * radial**4 + 0.245 * radial**5
    return tuple(float(value) for value in pigments + (np.log(tint) / width) ** 2)
