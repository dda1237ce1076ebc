# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights. Powers are Cycles': a point or spot of P watts has P / 4π W·sr⁻¹, an area of A m² has P / πA W·sr⁻¹·m⁻², a sun of
strength E has E W·m⁻²."""

from __future__ import annotations

import math
from typing import Any

import bottega
import bpy
import numpy as np

from . import axes
from .colors import ColorReader
from .context import Context
from .mixing import blackbody
from .nodes import CyclicNodes, named
from .report import Fidelity, Report
from .shaders import ShaderReader
from .textures import Pictures


# Radius of a light, in metres, from which its soft falloff is said to be another one: the light of smaller ones hardly differs.
SOFT = 0.11


def light_of(light: Any, matrix: Any, key: str, report: Report) -> bottega.Light | None:
    """Returns the light of an evaluated object of type LIGHT; `None`: it only guides sampling. `matrix`: from its space to the world."""
    data = light.data
    placed = axes.turned(matrix)
    color = np.maximum(np.array(data.color, np.float64), 0.0) * _strength(data, light.name, key, report)
    made = {"SUN": _sun, "AREA": _area}.get(data.type, _point)(data, placed, color)
    if data.type in ("POINT", "SPOT") and getattr(data, "use_soft_falloff", False) and data.shadow_soft_size > SOFT:
        report.add(key, light.name, "Soft Falloff", Fidelity.APPROXIMATED, "nearer than some radii it is brighter: its falloff is that of a sphere")
    if made is not None:
        made.visibility = visibility_of(light)
    if data.type == "SPOT" and bpy.app.version < (4, 0, 0):
        report.add(key, light.name, "Spot", Fidelity.APPROXIMATED, "away from its axis it is brighter, by one over the cosine of the angle")
    return made


def visibility_of(item: Any) -> bottega.Visibility:
    """Returns the kinds of ray for which an object is there."""
    return bottega.Visibility(
        item.visible_camera,
        item.visible_diffuse,
        item.visible_glossy,
        item.visible_transmission,
        item.visible_volume_scatter,
        item.visible_shadow,
    )


def _strength(data: Any, owner: str, key: str, report: Report) -> np.ndarray:
    """Returns what multiplies the color: power, exposure, temperature, and the emission of the nodes."""
    factor = np.full(3, max(data.energy, 0.0)) * 2.0 ** getattr(data, "exposure", 0.0)
    if getattr(data, "use_temperature", False):
        factor = factor * np.array(blackbody(data.temperature))
    tree = data.node_tree if data.use_nodes else None
    return np.maximum(factor if tree is None else factor * _of_nodes(tree, owner, key, report), 0.0)


def _of_nodes(tree: Any, owner: str, key: str, report: Report) -> np.ndarray:
    """Returns the emission of the nodes of a light, (3,)."""
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    if output is None:
        return np.zeros(3)

    def note(node: Any, fidelity: Fidelity, text: str) -> None:
        report.add(key, owner, node.label or node.name, fidelity, text)

    reader = ColorReader(Pictures(), note, Context("diffuse"))
    try:
        emission = ShaderReader(reader).shader(named(output, (), "Surface")).emission
    except CyclicNodes as error:
        report.add(key, owner, "Light Output", Fidelity.LEFT_OUT, f"{error}: the light is black")
        return np.zeros(3)
    if "ray" in reader.asks:
        report.add(key, owner, "Light Path", Fidelity.APPROXIMATED, "all rays find the light that diffuse ones find")
    if not emission.is_constant:
        report.add(key, owner, "Node tree", Fidelity.LEFT_OUT, "a picture on a light is left out: the light has its mean")
        return np.asarray(emission.load(), np.float64).reshape(-1, emission.channels).mean(0) * np.ones(3)
    return np.broadcast_to(emission.load(), (3,)).astype(np.float64)


def _numbers(values: Any) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _is_normalized(data: Any) -> bool:
    """Returns true if the power is that of the whole light, not per area: always before Blender 4.5."""
    return getattr(data, "normalize", True)


def _point(data: Any, placed: np.ndarray, color: np.ndarray) -> bottega.Light:
    radius = max(float(data.shadow_soft_size), 0.0)
    # Without a radius Cycles takes the power of 4 m².
    area = 1.0 if _is_normalized(data) else 4.0 * math.pi * radius * radius if radius > 0.0 else 4.0
    intensity = color / (4.0 * math.pi) * area
    fields = {"intensity": _numbers(intensity), "radius": radius}
    if data.type == "SPOT":
        place = axes.rows(axes.without_scale(placed))
        return bottega.SpotLight.blended(place, math.degrees(data.spot_size), data.spot_blend, **fields)
    return bottega.PointLight(_numbers(placed[:3, 3]), **fields)


def _sun(data: Any, placed: np.ndarray, color: np.ndarray) -> bottega.Light:
    place = axes.rows(axes.without_scale(placed))
    solid_angle = 1.0 if _is_normalized(data) or data.angle == 0.0 else math.pi * math.sin(0.5 * data.angle) ** 2
    return bottega.SunLight.by_matrix(place, _numbers(color * solid_angle), min(math.degrees(data.angle), 180.0))


def _area(data: Any, placed: np.ndarray, color: np.ndarray) -> bottega.Light | None:
    if getattr(getattr(data, "cycles", None), "is_portal", False):
        return None
    width = max(float(data.size), 1e-6)
    height = max(float(data.size_y), 1e-6) if data.shape in ("RECTANGLE", "ELLIPSE") else width
    is_round = data.shape in ("DISK", "ELLIPSE")
    # Before 4.0 an area of A m² had P / 4A W·sr⁻¹·m⁻².
    power = color * (math.pi / 4.0 if bpy.app.version < (4, 0, 0) else 1.0)
    if not _is_normalized(data):
        sides = np.linalg.norm(np.cross(placed[:3, 0], placed[:3, 1]))
        power = power * sides * width * height * (math.pi / 4.0 if is_round else 1.0)
    shape = "ellipse" if is_round else "rectangle"
    spread = min(max(math.degrees(data.spread), 0.2), 180.0)
    return bottega.AreaLight(axes.rows(placed), (width, height), _numbers(power), shape, spread)
