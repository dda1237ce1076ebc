# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights. Powers are Cycles': a point or spot of P watts has P / 4π W·sr⁻¹, an area of A m² has P / πA W·sr⁻¹·m⁻², a sun of
strength E has E W·m⁻²."""

from __future__ import annotations

import math
from typing import Any, Callable

import bottega
import bpy
import numpy as np

from . import axes
from .context import Context
from .fields import IDENTITY, Field, constant
from .mixing import blackbody
from .nodes import CyclicNodes, named
from .profiles import BY_PROFILE, LampPicture, LampReader, along_axis
from .report import Fidelity, Report
from .shaders import ShaderReader
from .textures import Pictures


# Radius of a light, in metres, from which its soft falloff is said to be another one: the light of smaller ones hardly differs.
SOFT = 0.11


def light_of(light: Any, matrix: Any, key: str, report: Report, pictures: Pictures) -> tuple[bottega.Light | None, LampPicture | None]:
    """Returns the light of an evaluated object of type LIGHT, and the picture that it needs; no light: it only guides sampling.

    - `matrix`: from its space to the world.
    """
    data = light.data
    placed = axes.turned(matrix)
    color = np.maximum(np.array(data.color, np.float64), 0.0) * _power(data)
    emission = _emission(data, light.name, key, report, pictures)
    picture = _picture(data, emission, light.name, key, report)
    if picture is None:
        color = np.maximum(color * _constant(data, emission), 0.0)
    elif data.type == "AREA":
        made = _area(data, placed, color, picture)
        if made is not None:
            made.visibility = visibility_of(light)
        return made, picture
    else:
        made = _lamp(data, placed, color, picture)
        made.visibility = visibility_of(light)
        return made, picture
    made = {"SUN": _sun, "AREA": _area}.get(data.type, _point)(data, placed, color)
    if data.type in ("POINT", "SPOT") and getattr(data, "use_soft_falloff", False) and data.shadow_soft_size > SOFT:
        report.add(key, light.name, "Soft Falloff", Fidelity.APPROXIMATED, "nearer than some radii it is brighter: its falloff is that of a sphere")
    if made is not None:
        made.visibility = visibility_of(light)
    if data.type == "SPOT" and bpy.app.version < (4, 0, 0):
        report.add(key, light.name, "Spot", Fidelity.APPROXIMATED, "away from its axis it is brighter, by one over the cosine of the angle")
    return made, None


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


def _power(data: Any) -> np.ndarray:
    """Returns what multiplies the color beside the nodes: power, exposure and temperature."""
    factor = np.full(3, max(data.energy, 0.0)) * 2.0 ** getattr(data, "exposure", 0.0)
    if getattr(data, "use_temperature", False):
        factor = factor * np.array(blackbody(data.temperature))
    return np.maximum(factor, 0.0)


def _emission(data: Any, owner: str, key: str, report: Report, pictures: Pictures) -> Field:
    """Returns the emission of the nodes of a light; 1 without nodes."""
    tree = data.node_tree if data.use_nodes else None
    if tree is None:
        return constant(1.0)
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    if output is None:
        return constant(0.0)

    def note(node: Any, fidelity: Fidelity, text: str) -> None:
        report.add(key, owner, node.label or node.name, fidelity, text)

    reader = LampReader(pictures, note, Context("diffuse"))
    try:
        emission = ShaderReader(reader).shader(named(output, (), "Surface")).emission
    except CyclicNodes as error:
        report.add(key, owner, "Light Output", Fidelity.LEFT_OUT, f"{error}: the light is black")
        return constant(0.0)
    if "ray" in reader.asks:
        report.add(key, owner, "Light Path", Fidelity.APPROXIMATED, "all rays find the light that diffuse ones find")
    return emission


def _constant(data: Any, emission: Field) -> np.ndarray:
    """Returns the emission of a light without a picture, (3,)."""
    if emission.is_constant:
        return np.broadcast_to(emission.load(), (3,)).astype(np.float64)
    if emission.placing is not None and emission.placing.uv_name == BY_PROFILE and data.type == "SUN":
        return along_axis(emission)
    return np.asarray(emission.load(), np.float64).reshape(-1, emission.channels).mean(0) * np.ones(3)


def _picture(data: Any, emission: Field, owner: str, key: str, report: Report) -> LampPicture | None:
    """Returns the picture of a lamp by direction; `None`: it has none, or one that is left out, with a note."""
    if emission.is_constant:
        return None
    placing = emission.placing
    is_profile = placing is not None and placing.uv_name == BY_PROFILE
    if is_profile and data.type == "SUN":
        # All its light has one direction.
        return None
    is_by_uv = placing is not None and placing.uv_name is None
    if data.type == "AREA" and is_by_uv:
        return LampPicture(emission)
    if data.type == "AREA" and is_profile:
        return LampPicture(emission, _spread_of(data), f"spread {data.spread:.9g}")
    is_plain = is_by_uv and placing.transform == IDENTITY and placing.wrap == "repeat"  # type: ignore[union-attr]
    if not (is_profile or (data.type == "POINT" and is_plain)):
        report.add(key, owner, "Node tree", Fidelity.LEFT_OUT, "a picture on a light is left out: the light has its mean")
        return None
    if not is_profile and data.shadow_soft_size > SOFT and not getattr(data, "use_soft_falloff", False):
        text = "its picture is looked up by the direction of light; by Cycles, by the normal of its sphere"
        report.add(key, owner, "Soft Falloff", Fidelity.APPROXIMATED, text)
    if data.type != "SPOT":
        return LampPicture(emission)
    outer = math.cos(0.5 * data.spot_size)
    inner = outer + (1.0 - outer) * max(data.spot_blend, 1e-3)

    def cone(cosines: Any) -> Any:
        share = np.clip((cosines - outer) / (inner - outer), 0.0, 1.0)
        return share * share * (3.0 - 2.0 * share)

    return LampPicture(emission, cone, f"cone {data.spot_size:.9g} {data.spot_blend:.9g}")


def _numbers(values: Any) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _is_normalized(data: Any) -> bool:
    """Returns true if the power is that of the whole light, not per area: always before Blender 4.5."""
    return getattr(data, "normalize", True)


def _spread_of(data: Any) -> Callable[[Any], Any] | None:
    """Returns the factor of an area light's radiance by the cosine to its axis; `None`: it emits into all directions."""
    half = 0.5 * max(data.spread, math.radians(0.2))
    if half > 0.5 * math.pi - 1e-4:
        return None

    def factor(cosines: Any) -> Any:
        tangents = np.sqrt(1.0 - np.minimum(cosines * cosines, 1.0)) / np.maximum(cosines, 1e-6)
        return np.maximum(math.tan(half) - tangents, 0.0) / (math.tan(half) - half)

    return factor


def _fields_of_lamp(data: Any, color: np.ndarray) -> dict[str, Any]:
    """Returns intensity and radius of a point or a spot."""
    radius = max(float(data.shadow_soft_size), 0.0)
    # Without a radius Cycles takes the power of 4 m².
    area = 1.0 if _is_normalized(data) else 4.0 * math.pi * radius * radius if radius > 0.0 else 4.0
    return {"intensity": _numbers(color / (4.0 * math.pi) * area), "radius": radius}


def _lamp(data: Any, placed: np.ndarray, color: np.ndarray, picture: LampPicture) -> bottega.Light:
    place, rotation = _numbers(placed[:3, 3]), _rotation(placed, picture)
    mapping = "latitude_longitude_to_poles"
    return bottega.GoniometricLight(picture.key, place, rotation, mapping=mapping, **_fields_of_lamp(data, color))


def _rotation(placed: np.ndarray, picture: LampPicture) -> list[tuple[float, ...]]:
    """Returns the rotation from the space of a picture to the world, by rows."""
    return [_numbers(row) for row in axes.without_scale(placed)[:3, :3] @ picture.lamp_from_picture]


def _point(data: Any, placed: np.ndarray, color: np.ndarray) -> bottega.Light:
    fields = _fields_of_lamp(data, color)
    if data.type == "SPOT":
        place = axes.rows(axes.without_scale(placed))
        return bottega.SpotLight.blended(place, math.degrees(data.spot_size), data.spot_blend, **fields)
    return bottega.PointLight(_numbers(placed[:3, 3]), **fields)


def _sun(data: Any, placed: np.ndarray, color: np.ndarray) -> bottega.Light:
    place = axes.rows(axes.without_scale(placed))
    solid_angle = 1.0 if _is_normalized(data) or data.angle == 0.0 else math.pi * math.sin(0.5 * data.angle) ** 2
    return bottega.SunLight.by_matrix(place, _numbers(color * solid_angle), min(math.degrees(data.angle), 180.0))


def _area(data: Any, placed: np.ndarray, color: np.ndarray, picture: LampPicture | None = None) -> bottega.AreaLight | None:
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
    made = bottega.AreaLight(axes.rows(placed), (width, height), _numbers(power), shape, spread)
    if picture is not None and picture.is_profile:
        made.spread, made.profile, made.profile_rotation = 180.0, picture.key, _rotation(placed, picture)
    elif picture is not None:
        made.texture = picture.texture()
    return made
