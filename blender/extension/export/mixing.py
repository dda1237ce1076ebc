# SPDX-License-Identifier: GPL-3.0-or-later
"""The formulas of Blender's nodes for numbers and colors, over NumPy arrays whose last axis has the channels."""

from __future__ import annotations

from typing import Any, Callable

import numpy as np

Array = Any

# Blend modes of the nodes Mix and MixRGB: the value at factor 1, or with the factor where that is not linear in it.
_MODES: dict[str, Callable[[Array, Array], Array]] = {
    "MIX": lambda a, b: b,
    "ADD": lambda a, b: a + b,
    "MULTIPLY": lambda a, b: a * b,
    "SUBTRACT": lambda a, b: a - b,
    "DIFFERENCE": lambda a, b: np.abs(a - b),
    "EXCLUSION": lambda a, b: np.maximum(a + b - 2.0 * a * b, 0.0),
    "DARKEN": np.minimum,
    "LIGHTEN": np.maximum,
    "DIVIDE": lambda a, b: np.where(b != 0.0, a / np.where(b != 0.0, b, 1.0), a),
}


def mix(mode: str, factor: Array, a: Array, b: Array) -> Array | None:
    """Mixes two colors as the node Mix does, or returns `None` for an unknown mode."""
    if mode in _MODES:
        return a + factor * (_MODES[mode](a, b) - a)
    if mode == "SCREEN":
        return 1.0 - (1.0 - factor + factor * (1.0 - b)) * (1.0 - a)
    if mode == "OVERLAY":
        low = a * (1.0 - factor + 2.0 * factor * b)
        high = 1.0 - (1.0 - factor + 2.0 * factor * (1.0 - b)) * (1.0 - a)
        return np.where(a < 0.5, low, high)
    if mode == "SOFT_LIGHT":
        screen = 1.0 - (1.0 - b) * (1.0 - a)
        return (1.0 - factor) * a + factor * ((1.0 - a) * b * a + a * screen)
    if mode == "LINEAR_LIGHT":
        return a + factor * (2.0 * b - 1.0)
    if mode in ("HUE", "SATURATION", "VALUE", "COLOR"):
        return a + factor * (_by_hsv(mode, a, b) - a)
    return None


def _by_hsv(mode: str, a: Array, b: Array) -> Array:
    a, b = np.broadcast_arrays(a, b)
    x, y = hsv_of_rgb(a), hsv_of_rgb(b)
    chosen = {"HUE": (y, x, x), "SATURATION": (x, y, x), "VALUE": (x, x, y), "COLOR": (y, y, x)}[mode]
    result = rgb_of_hsv(np.stack([chosen[i][..., i] for i in range(3)], -1))
    # A gray has no hue, and stays.
    kept = y[..., 1:2] == 0.0 if mode in ("HUE", "COLOR") else x[..., 1:2] == 0.0 if mode == "SATURATION" else None
    return result if kept is None else np.where(kept, a, result)


def hsv_of_rgb(color: Array) -> Array:
    """Converts R G B to hue, saturation and value."""
    high, low = color.max(-1), color.min(-1)
    span = high - low
    safe = np.where(span > 0.0, span, 1.0)
    r, g, b = color[..., 0], color[..., 1], color[..., 2]
    hue = np.where(high == r, (g - b) / safe, np.where(high == g, 2.0 + (b - r) / safe, 4.0 + (r - g) / safe))
    hue = np.where(span > 0.0, (hue / 6.0) % 1.0, 0.0)
    saturation = np.where(high > 0.0, span / np.where(high > 0.0, high, 1.0), 0.0)
    return np.stack([hue, saturation, high], -1)


def rgb_of_hsv(hsv: Array) -> Array:
    """Converts hue, saturation and value to R G B."""
    hue, saturation, value = hsv[..., 0:1], hsv[..., 1:2], hsv[..., 2:3]
    offsets = np.array([0.0, 2.0 / 3.0, 1.0 / 3.0], np.float32)
    ramp = np.clip(np.abs(((hue + offsets) % 1.0) * 6.0 - 3.0) - 1.0, 0.0, 1.0)
    return value * (1.0 - saturation + saturation * ramp)


def hue_saturation(hue: Array, saturation: Array, value: Array, factor: Array, color: Array) -> Array:
    """The node Hue/Saturation/Value."""
    hsv = hsv_of_rgb(color)
    changed = np.stack(
        [(hsv[..., 0] + hue[..., 0] + 0.5) % 1.0, np.clip(hsv[..., 1] * saturation[..., 0], 0.0, 1.0), hsv[..., 2] * value[..., 0]], -1
    )
    return color + factor * (np.maximum(rgb_of_hsv(changed), 0.0) - color)


def bright_contrast(color: Array, bright: Array, contrast: Array) -> Array:
    """The node Brightness/Contrast."""
    return np.maximum((1.0 + contrast) * color + bright - 0.5 * contrast, 0.0)


def _safe_divide(a: Array, b: Array) -> Array:
    return np.where(b != 0.0, a / np.where(b != 0.0, b, 1.0), 0.0)


def _power(a: Array, b: Array) -> Array:
    whole = b == np.rint(b)
    return np.where((a < 0.0) & ~whole, 0.0, np.abs(a) ** b * np.where((a < 0.0) & (np.rint(b) % 2 == 1), -1.0, 1.0))


def _wrap(a: Array, high: Array, low: Array) -> Array:
    span = high - low
    return np.where(span != 0.0, a - span * np.floor(_safe_divide(a - low, span)), low)


def _ping_pong(a: Array, scale: Array) -> Array:
    twice = np.where(scale != 0.0, 2.0 * scale, 1.0)
    return np.where(scale != 0.0, np.abs((((a - scale) / twice) % 1.0) * twice - scale), 0.0)


MATH: dict[str, Callable[[Array, Array, Array], Array]] = {
    "ADD": lambda a, b, c: a + b,
    "SUBTRACT": lambda a, b, c: a - b,
    "MULTIPLY": lambda a, b, c: a * b,
    "DIVIDE": lambda a, b, c: _safe_divide(a, b),
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": lambda a, b, c: _power(a, b),
    "LOGARITHM": lambda a, b, c: np.where(
        (a > 0.0) & (b > 0.0) & (b != 1.0), np.log(np.maximum(a, 1e-30)) / np.log(np.where((b > 0.0) & (b != 1.0), b, 2.0)), 0.0
    ),
    "SQRT": lambda a, b, c: np.sqrt(np.maximum(a, 0.0)),
    "INVERSE_SQRT": lambda a, b, c: np.where(a > 0.0, 1.0 / np.sqrt(np.maximum(a, 1e-30)), 0.0),
    "ABSOLUTE": lambda a, b, c: np.abs(a),
    "EXPONENT": lambda a, b, c: np.exp(np.minimum(a, 80.0)),
    "MINIMUM": lambda a, b, c: np.minimum(a, b),
    "MAXIMUM": lambda a, b, c: np.maximum(a, b),
    "LESS_THAN": lambda a, b, c: (a < b).astype(np.float32),
    "GREATER_THAN": lambda a, b, c: (a > b).astype(np.float32),
    "SIGN": lambda a, b, c: np.sign(a),
    "COMPARE": lambda a, b, c: (np.abs(a - b) <= np.maximum(c, 1e-5)).astype(np.float32),
    "ROUND": lambda a, b, c: np.floor(a + 0.5),
    "FLOOR": lambda a, b, c: np.floor(a),
    "CEIL": lambda a, b, c: np.ceil(a),
    "TRUNC": lambda a, b, c: np.trunc(a),
    "FRACT": lambda a, b, c: a - np.floor(a),
    "MODULO": lambda a, b, c: np.where(b != 0.0, np.fmod(a, np.where(b != 0.0, b, 1.0)), 0.0),
    "FLOORED_MODULO": lambda a, b, c: np.where(b != 0.0, a - np.floor(_safe_divide(a, b)) * b, 0.0),
    "WRAP": _wrap,
    "SNAP": lambda a, b, c: np.floor(_safe_divide(a, b)) * b,
    "PINGPONG": lambda a, b, c: _ping_pong(a, b),
    "SINE": lambda a, b, c: np.sin(a),
    "COSINE": lambda a, b, c: np.cos(a),
    "TANGENT": lambda a, b, c: np.tan(a),
    "ARCSINE": lambda a, b, c: np.arcsin(np.clip(a, -1.0, 1.0)),
    "ARCCOSINE": lambda a, b, c: np.arccos(np.clip(a, -1.0, 1.0)),
    "ARCTANGENT": lambda a, b, c: np.arctan(a),
    "ARCTAN2": lambda a, b, c: np.arctan2(a, b),
    "RADIANS": lambda a, b, c: np.radians(a),
    "DEGREES": lambda a, b, c: np.degrees(a),
}

VECTOR_MATH: dict[str, Callable[[Array, Array, Array, Array], Array]] = {
    "ADD": lambda a, b, c, s: a + b,
    "SUBTRACT": lambda a, b, c, s: a - b,
    "MULTIPLY": lambda a, b, c, s: a * b,
    "DIVIDE": lambda a, b, c, s: _safe_divide(a, b),
    "MULTIPLY_ADD": lambda a, b, c, s: a * b + c,
    "SCALE": lambda a, b, c, s: a * s,
    "MINIMUM": lambda a, b, c, s: np.minimum(a, b),
    "MAXIMUM": lambda a, b, c, s: np.maximum(a, b),
    "ABSOLUTE": lambda a, b, c, s: np.abs(a),
    "FLOOR": lambda a, b, c, s: np.floor(a),
    "CEIL": lambda a, b, c, s: np.ceil(a),
    "FRACTION": lambda a, b, c, s: a - np.floor(a),
}


def map_range(kind: str, value: Array, a: Array, b: Array, to_a: Array, to_b: Array, steps: Array) -> Array:
    """The node Map Range, not clamped."""
    share = _safe_divide(value - a, b - a)
    if kind == "STEPPED":
        share = np.where(steps > 0.0, np.floor(share * (steps + 1.0)) / np.maximum(steps, 1e-12), 0.0)
    elif kind in ("SMOOTHSTEP", "SMOOTHERSTEP"):
        share = np.clip(share, 0.0, 1.0)
        share = share * share * (3.0 - 2.0 * share) if kind == "SMOOTHSTEP" else share**3 * (share * (share * 6.0 - 15.0) + 10.0)
    return to_a + share * (to_b - to_a)


def blackbody(kelvin: float) -> tuple[float, float, float]:
    """Returns the color of a black body in linear Rec. 709, with luminance 1 (Kang et al. 2002, through CIE xy)."""
    t = min(max(kelvin, 800.0), 40000.0)
    if t <= 4000.0:
        x = -0.2661239e9 / t**3 - 0.2343589e6 / t**2 + 0.8776956e3 / t + 0.179910
    else:
        x = -3.0258469e9 / t**3 + 2.1070379e6 / t**2 + 0.2226347e3 / t + 0.240390
    if t <= 2222.0:
        y = -1.1063814 * x**3 - 1.34811020 * x**2 + 2.18555832 * x - 0.20219683
    elif t <= 4000.0:
        y = -0.9549476 * x**3 - 1.37418593 * x**2 + 2.09137015 * x - 0.16748867
    else:
        y = 3.0817580 * x**3 - 5.87338670 * x**2 + 3.75112997 * x - 0.37001483
    xyz = np.array([x / y, 1.0, (1.0 - x - y) / y])
    matrix = np.array([[3.2404542, -1.5371385, -0.4985314], [-0.969266, 1.8760108, 0.041556], [0.0556434, -0.2040259, 1.0572252]])
    r, g, b = np.maximum(matrix @ xyz, 0.0)
    return float(r), float(g), float(b)
