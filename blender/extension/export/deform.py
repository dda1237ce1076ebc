# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes whose vertices move while the shutter is open."""

from __future__ import annotations

from typing import Any

import bottega
import numpy as np

from .meshes import MeshArrays, Shape

Array = Any

# How far vertices of a triangle that has no area for a moment are moved then, as a share of the greatest coordinate.
NUDGE = 1e-6


def moving_mesh(arrays: MeshArrays, keys: list[tuple[float, Shape]], materials: list[str]) -> bottega.Mesh:
    """Makes a mesh that has other positions and normals at some times, ascending.

    Corners become one vertex where they have the same values at all times, since keys must not differ in their vertices.
    """
    normals = [arrays.normals, *(shape.normals for _, shape in keys)]
    first, vertex_of = _vertices(arrays, normals)
    triangles = vertex_of[arrays.triangles].astype(np.int32)
    rows = arrays.corner_vertices[first]
    positions = [np.ascontiguousarray(one[rows]) for one in (arrays.positions, *(shape.positions for _, shape in keys))]
    kept = _with_area(positions, triangles)

    def of(values: Array | None) -> Array | None:
        return None if values is None else np.ascontiguousarray(values[first])

    return bottega.Mesh(
        positions[0],
        np.ascontiguousarray(triangles[kept]),
        None,
        of(normals[0]),
        of(arrays.uvs),
        of(arrays.uvs2),
        of(arrays.colors),
        materials,
        np.ascontiguousarray(arrays.triangle_materials[kept]),
        drop_empty=True,
        motion=[(time, places, of(turned)) for (time, _), places, turned in zip(keys, positions[1:], normals[1:])],
    )


def velocity_keys(arrays: MeshArrays, velocities: Array, seconds: float, open: float, close: float) -> list[tuple[float, Shape]]:
    """Returns keys of vertices that move evenly, and are where they are in the middle of the span.

    - `velocities`: (V, 3), per second. `seconds`: how long the shutter is open. `open`, `close`: when, in the unit of keys.
    """
    way = (0.5 * seconds) * velocities
    return [(time, Shape(arrays.positions + sign * way, arrays.normals, None)) for time, sign in ((open, -1), (close, 1))]


def _vertices(arrays: MeshArrays, normals: list[Array | None]) -> tuple[Array, Array]:
    """Unites corners of a vertex whose values are the same at all times. Returns one corner of each new vertex, and the new vertex of each
    corner."""
    # Values are compared by a sum of 64 bits: two different ones have the same by chance once in 10^19 times.
    factors = np.random.default_rng(7)
    total = arrays.corner_vertices.astype(np.uint64) * _odd(factors, 1)[0]
    for values in (*normals, arrays.uvs, arrays.uvs2, arrays.colors):
        if values is not None:
            bits = np.ascontiguousarray(values, np.float32).view(np.uint32).astype(np.uint64)
            mixed = (bits + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
            total += ((mixed ^ (mixed >> np.uint64(29))) * _odd(factors, bits.shape[1])).sum(axis=1, dtype=np.uint64)
    _, first, inverse = np.unique(total, return_index=True, return_inverse=True)
    # Number the vertices by their first corner
    order = np.argsort(first)
    number = np.empty(len(first), np.int64)
    number[order] = np.arange(len(first))
    return first[order], number[inverse.reshape(-1)]


def _odd(factors: Any, count: int) -> Array:
    return factors.integers(0, 2**64, count, np.uint64, endpoint=False) | np.uint64(1)


def _with_area(positions: list[Array], triangles: Array) -> Array:
    """Returns which triangles have an area at some time, (T,). Moves their vertices a little at times at which they have none."""
    empty = np.array([_is_empty(places, triangles) for places in positions])
    kept = ~empty.all(axis=0)
    for places, without in zip(positions, empty):
        vertices = np.unique(triangles[without & kept])
        if len(vertices) > 0:
            size = NUDGE * max(float(np.abs(places).max()), 1e-6)
            places[vertices] += np.random.default_rng(7).uniform(-size, size, (len(vertices), 3)).astype(np.float32)
    return kept


def _is_empty(positions: Array, triangles: Array) -> Array:
    """Returns which triangles have no area, (T,), as the renderer finds it."""
    a, b, c = (positions[triangles[:, corner]].astype(np.float64) for corner in range(3))
    return ~np.cross(b - a, c - a).any(axis=1)
