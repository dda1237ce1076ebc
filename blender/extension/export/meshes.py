# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes: arrays by corner, as Blender keeps them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bottega
import bpy
import numpy as np

Array = Any


@dataclass
class MeshArrays:
    """The arrays of a mesh, which belong to nobody else. See `bottega.Mesh`."""

    positions: Array
    triangles: Array
    corner_vertices: Array
    normals: Array
    uvs: Array | None
    uvs2: Array | None
    colors: Array | None
    triangle_materials: Array

    @property
    def slot_count(self) -> int:
        """The number of material slots that triangles use."""
        return int(self.triangle_materials.max()) + 1 if len(self.triangle_materials) else 1

    def to_mesh(self, materials: list[str]) -> bottega.Mesh:
        """Makes the mesh with keys of materials by slot."""
        return bottega.Mesh(
            self.positions,
            self.triangles,
            self.corner_vertices,
            self.normals,
            self.uvs,
            self.uvs2,
            self.colors,
            materials,
            self.triangle_materials,
            drop_empty=True,
        )


def arrays_of(mesh: Any, uv_names: tuple[str | None, ...], color_name: str | None) -> MeshArrays | None:
    """Reads a mesh of Blender. Returns `None` if it has no triangle of finite vertices.

    - `uv_names`: names of at most two sets of texture coordinates; `None`: the set that is active for rendering.
    - `color_name`: the color attribute; `None`: none; empty: the one that is active for rendering.
    """
    mesh.calc_loop_triangles()
    count, corners = len(mesh.loop_triangles), len(mesh.loops)
    if count == 0:
        return None
    positions = _positions(mesh)
    triangles = _ints(mesh.loop_triangles, "loops", 3 * count).reshape(-1, 3)
    corner_vertices = _corner_vertices(mesh)
    materials = _slots(mesh, count)

    # Triangles with a vertex that is not a number are left out.
    if not np.isfinite(positions).all():
        broken = ~np.isfinite(positions).all(axis=1)
        kept = ~broken[corner_vertices[triangles]].any(axis=1)
        positions[broken] = 0.0
        triangles, materials = np.ascontiguousarray(triangles[kept]), np.ascontiguousarray(materials[kept])
        if len(triangles) == 0:
            return None
    uvs = [_uvs(mesh, name, corners) for name in uv_names[:2]]
    uvs += [None] * (2 - len(uvs))
    return MeshArrays(
        positions, triangles, corner_vertices, _normals(mesh, corners), uvs[0], uvs[1], _colors(mesh, color_name), materials
    )


@dataclass
class Shape:
    """What of a mesh or of hair changes while it keeps its triangles: float32, (V, 3), and float32, (C, 3), by corner.

    `corner_vertices`: int32, (C,), the vertex of each corner. Hair has positions alone.
    """

    positions: Array
    normals: Array | None = None
    corner_vertices: Array | None = None

    def fits(self, other: Shape) -> bool:
        """Returns true if another shape has the same vertices and corners."""
        corners, others = self.corner_vertices, other.corner_vertices
        same_corners = corners is others or (corners is not None and others is not None and np.array_equal(corners, others))
        return self.positions.shape == other.positions.shape and same_corners

    def equals(self, other: Shape) -> bool:
        """Returns true if another shape has the same positions and normals."""
        normals, others = self.normals, other.normals
        same_normals = normals is others or (normals is not None and others is not None and np.array_equal(normals, others))
        return np.array_equal(self.positions, other.positions) and same_normals


def shape_of(mesh: Any) -> Shape:
    """Copies the shape of a mesh of Blender."""
    return Shape(_positions(mesh), _normals(mesh, len(mesh.loops)), _corner_vertices(mesh))


def velocities_of(mesh: Any) -> Array | None:
    """Returns the velocities that simulations and Geometry Nodes give to vertices: float32, (V, 3), per second; `None`: there are none."""
    attribute = mesh.attributes.get("velocity")
    if attribute is None or attribute.domain != "POINT" or attribute.data_type != "FLOAT_VECTOR":
        return None
    velocities = _floats(attribute.data, "vector", len(attribute.data), 3)
    return velocities if velocities.any() and np.isfinite(velocities).all() else None


def _floats(collection: Any, name: str, count: int, width: int) -> Array:
    array = np.empty(count * width, np.float32)
    collection.foreach_get(name, array)
    return array.reshape(count, width)


def _ints(collection: Any, name: str, count: int) -> Array:
    array = np.empty(count, np.int32)
    collection.foreach_get(name, array)
    return array


def _attribute(mesh: Any, name: str) -> Any:
    """Returns an attribute that Blender keeps as an array, whose reading takes no time; `None`: there is none."""
    return mesh.attributes.get(name) if bpy.app.version >= (4, 1, 0) else None


def _positions(mesh: Any) -> Array:
    attribute = _attribute(mesh, "position")
    if attribute is not None:
        return _floats(attribute.data, "vector", len(mesh.vertices), 3)
    return _floats(mesh.vertices, "co", len(mesh.vertices), 3)


def _corner_vertices(mesh: Any) -> Array:
    attribute = _attribute(mesh, ".corner_vert")
    if attribute is not None:
        return _ints(attribute.data, "value", len(mesh.loops))
    return _ints(mesh.loops, "vertex_index", len(mesh.loops))


def _slots(mesh: Any, count: int) -> Array:
    """Returns the material slot of each triangle."""
    if bpy.app.version >= (4, 1, 0):
        attribute = mesh.attributes.get("material_index")
        if attribute is None or attribute.domain != "FACE" or attribute.data_type != "INT":
            return np.zeros(count, np.int32)
        of_faces = _ints(attribute.data, "value", len(mesh.polygons))
        slots = of_faces[_ints(mesh.loop_triangle_polygons, "value", count)]
    else:
        slots = _ints(mesh.loop_triangles, "material_index", count)
    return np.maximum(slots, 0)


def _normals(mesh: Any, corners: int) -> Array | None:
    if hasattr(mesh, "corner_normals"):
        normals = _floats(mesh.corner_normals, "vector", corners, 3)
    else:
        # Before Blender 4.1.
        mesh.calc_normals_split()
        normals = _floats(mesh.loops, "normal", corners, 3)
    # A corner of a degenerate face has the normal 0, which no surface has.
    lengths = np.einsum("ij,ij->i", normals, normals)
    bad = ~(lengths > 0.25)
    if bad.any():
        normals[bad] = (0.0, 0.0, 1.0)
    return normals


def uv_layer(mesh: Any, name: str | None) -> Any:
    """Returns a set of texture coordinates by name, or the one for rendering; `None`: there is none."""
    if name:
        return mesh.uv_layers.get(name)
    return next((layer for layer in mesh.uv_layers if layer.active_render), None)


def _uvs(mesh: Any, name: str | None, corners: int) -> Array | None:
    layer = uv_layer(mesh, name)
    if layer is None:
        return None
    if hasattr(layer, "uv"):
        uvs = _floats(layer.uv, "vector", corners, 2)
    else:
        uvs = _floats(layer.data, "uv", corners, 2)
    # v runs downwards.
    uvs[:, 1] = 1.0 - uvs[:, 1]
    if not np.isfinite(uvs).all():
        np.nan_to_num(uvs, copy=False, nan=0.0, posinf=0.0, neginf=0.0)
    return uvs


def _colors(mesh: Any, name: str | None) -> Array | None:
    if name is None:
        return None
    attributes = mesh.color_attributes
    index = getattr(attributes, "render_color_index", -1)
    attribute = attributes.get(name) if name else (attributes[index] if 0 <= index < len(attributes) else None)
    if attribute is None or attribute.domain not in ("POINT", "CORNER"):
        return None
    colors = _floats(attribute.data, "color", len(attribute.data), 4)
    if attribute.domain == "POINT":
        colors = colors[_ints(mesh.loops, "vertex_index", len(mesh.loops))]
    return np.ascontiguousarray(np.nan_to_num(colors, nan=0.0, posinf=1.0, neginf=0.0))
