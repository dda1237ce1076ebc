# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights. Powers are Cycles': a point or spot of P watts has P / 4π W·sr⁻¹, an area of A m² has P / πA W·sr⁻¹·m⁻², a sun of
strength E has E W·m⁻²."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import bottega
import numpy as np

from . import axes
from .mixing import blackbody
from .report import Fidelity, Report

DISK_SIDES = 64


@dataclass
class MadeLight:
    """A light: a light of the scene, or a surface that emits.

    - `light`: `None`: a surface.
    - `mesh`, `transform`, `material`: the surface. `sphere`: center and radius.
    """

    light: bottega.Light | None = None
    mesh: bottega.Mesh | None = None
    transform: list[list[float]] | None = None
    material: bottega.Material | None = None
    sphere: tuple[tuple[float, ...], float] | None = None


def light_of(light: Any, matrix: Any, key: str, report: Report) -> MadeLight:
    """Returns the light of an evaluated object of type LIGHT. `matrix`: from its space to the world."""
    data = light.data
    placed = axes.turned(matrix)
    color = np.maximum(np.array(data.color, np.float64), 0.0) * _strength(data, light.name, key, report)
    if data.type == "SUN":
        return _sun(data, placed, color, light.name, key, report)
    if data.type == "AREA":
        return _area(data, placed, color, light.name, key, report)
    return _point(data, placed, color, light.name, key, report)


def _strength(data: Any, owner: str, key: str, report: Report) -> np.ndarray:
    """Returns what multiplies the color: power, exposure, temperature, and an Emission node of constant strength."""
    factor = np.full(3, max(data.energy, 0.0)) * 2.0 ** getattr(data, "exposure", 0.0)
    if getattr(data, "use_temperature", False):
        factor = factor * np.array(blackbody(data.temperature))
    tree = data.node_tree if data.use_nodes else None
    if tree is not None:
        emission = next((node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission"), None)
        if emission is None or any(socket.is_linked for socket in emission.inputs):
            report.add(key, owner, "Node tree", Fidelity.LEFT_OUT, "nodes of lights are left out, but for an Emission of constant color and strength")
        else:
            factor = factor * np.array(emission.inputs["Color"].default_value)[:3] * emission.inputs["Strength"].default_value
    return np.maximum(factor, 0.0)


def _point(data: Any, placed: np.ndarray, color: np.ndarray, owner: str, key: str, report: Report) -> MadeLight:
    position = tuple(float(value) for value in placed[:3, 3])
    radius = max(float(data.shadow_soft_size), 0.0)
    intensity = color / (4.0 * math.pi)
    if getattr(data, "normalize", True) is False:
        intensity = intensity * math.pi * radius * radius
    numbers = tuple(float(value) for value in intensity)
    if data.type == "SPOT":
        outer = math.degrees(data.spot_size) / 2.0
        inner = min(_inner_angle(outer, data.spot_blend), outer * 0.9999)
        if radius > 0.0:
            report.add(key, owner, "Radius", Fidelity.APPROXIMATED, "a spot is a point: its shadows are hard")
        direction = tuple(float(-value) for value in placed[:3, 2])
        return MadeLight(bottega.SpotLight(position, direction, numbers, inner, outer, "smooth_cosine"))
    if radius <= 1e-4:
        return MadeLight(bottega.PointLight(position, numbers))
    radiance = tuple(float(value / (math.pi * radius * radius)) for value in intensity)
    return MadeLight(material=_lamp(radiance), sphere=(position, radius))


def _inner_angle(outer: float, blend: float) -> float:
    """Returns the angle up to which a spot of Blender is full: its blend is a share of the slope of the angle."""
    outer_cosine = math.cos(math.radians(outer))
    # Cycles: the smooth step of (cos / length - spot) / blend, in the plane at distance 1.
    full = outer_cosine + (1.0 - outer_cosine) * min(max(blend, 0.0), 1.0)
    return math.degrees(math.acos(min(full, 1.0)))


def _sun(data: Any, placed: np.ndarray, color: np.ndarray, owner: str, key: str, report: Report) -> MadeLight:
    direction = tuple(float(-value) for value in placed[:3, 2])
    irradiance = tuple(float(value) for value in color)
    fields = {}
    if "angle" in bottega.SunLight.__dataclass_fields__:
        fields["angle"] = math.degrees(data.angle)
    elif data.angle > 0.01:
        report.add(key, owner, "Angle", Fidelity.APPROXIMATED, "a sun is a direction: its shadows are hard")
    return MadeLight(bottega.SunLight(direction, irradiance, **fields))


def _area(data: Any, placed: np.ndarray, color: np.ndarray, owner: str, key: str, report: Report) -> MadeLight:
    is_round = data.shape in ("DISK", "ELLIPSE")
    width = float(data.size)
    height = float(data.size_y) if data.shape in ("RECTANGLE", "ELLIPSE") else width
    mesh = _disk() if is_round else _square()
    transform = placed @ np.diag([max(width, 1e-6) / 2.0, max(height, 1e-6) / 2.0, 1.0, 1.0])
    # The power is that of the area in the world.
    area = float(np.linalg.norm(np.cross(transform[:3, 0], transform[:3, 1]))) * (math.pi if is_round else 4.0)
    radiance = color / math.pi / (area if getattr(data, "normalize", True) else 1.0)
    if data.spread < math.radians(179.0):
        report.add(key, owner, "Spread", Fidelity.APPROXIMATED, "the light spreads by 180°")
    if getattr(data, "cycles", None) is not None and getattr(data.cycles, "is_portal", False):
        report.add(key, owner, "Portal", Fidelity.LEFT_OUT, "portals change noise only, and are left out")
        return MadeLight()
    lamp = _lamp(tuple(float(value) for value in radiance))
    return MadeLight(mesh=mesh, transform=axes.rows(transform), material=lamp)


def _lamp(radiance: tuple[float, ...]) -> bottega.Material:
    """Returns the material of a light with a surface: as in Cycles it emits from its front and casts no shadow."""
    clear = bottega.Dielectric(eta=1.0, thin=True)
    return bottega.Material(clear, emission=radiance, emission_sides="front", see_through=True)


def _square() -> bottega.Mesh:
    """A square of side 2 whose front faces -z."""
    positions = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    return bottega.Mesh(positions, np.array([[0, 2, 1], [0, 3, 2]], np.int32), materials=("lamp",))


def _disk() -> bottega.Mesh:
    """A disk of the area of a circle of radius 1, whose front faces -z."""
    angles = np.arange(DISK_SIDES) * (2.0 * math.pi / DISK_SIDES)
    radius = math.sqrt(2.0 * math.pi / (DISK_SIDES * math.sin(2.0 * math.pi / DISK_SIDES)))
    rim = np.stack([radius * np.cos(angles), radius * np.sin(angles), 0.0 * angles], -1)
    positions = np.concatenate([[[0.0, 0.0, 0.0]], rim]).astype(np.float32)
    index = np.arange(DISK_SIDES)
    triangles = np.stack([0 * index, (index + 1) % DISK_SIDES + 1, index + 1], -1).astype(np.int32)
    return bottega.Mesh(positions, triangles, materials=("lamp",))
