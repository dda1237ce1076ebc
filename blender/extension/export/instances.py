# SPDX-License-Identifier: GPL-3.0-or-later
"""The instances of an evaluated scene, in groups of one mesh and one list of materials."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Iterable

import bottega
import numpy as np

from .lights import visibility_of
from .nodes import uid_of


# The farthest coordinate at which things are placed.
FARTHEST = 1e17


@dataclass
class Group:
    """Instances of a mesh that come from one object.

    - `key`: of the object in the scene. `mesh_key`: of its mesh.
    - `owner`: session number of the object. `data`: the evaluated mesh, curves or particle system, valid only during the pass.
    - `kind`: `MESH`, `CURVES` or `PARTICLES`.
    - `slots`: materials by slot: `None` is the default material.
    - `visibility`: the kinds of ray for which they are there. `item`: the evaluated object, valid only during the pass.
    - `is_instance`: they are made by another object. `bounds`: corners of the box around the mesh, (8, 3).
    - `rows`: indices of the instances in the pass.
    """

    key: str
    mesh_key: str
    owner: Any
    data_owner: Any
    data: Any
    slots: list[Any]
    visibility: bottega.Visibility
    item: Any
    is_instance: bool
    bounds: Any
    kind: str = "MESH"
    rows: list[int] = field(default_factory=list)


@dataclass
class Pass:
    """What one pass over the instances has found; it holds references into Blender only until the export ends.

    - `matrices`: float32, (N, 4, 4), from object to world space, by rows.
    - `random_ids`: int32, (N,), Blender's random numbers of instances.
    - `lights`, `volumes`: evaluated objects, with key and index of the matrix.
    - `ids`: int32, (N, 9), numbers that name an instance at all times, where they were asked for.
    """

    matrices: Any
    random_ids: Any
    groups: dict[str, Group]
    lights: list[tuple[str, Any, int]]
    skipped: dict[str, str]
    volumes: list[tuple[str, Any, int]] = field(default_factory=list)
    ids: Any = None


def gather(depsgraph: Any, is_shown: Any = None, has_ids: bool = False) -> Pass:
    """Passes over the instances of an evaluated scene.

    - `is_shown`: called with an object; objects for which it returns false are left out.
    - `has_ids`: the pass gets `ids`.
    """
    instances = depsgraph.object_instances
    count = len(instances)
    matrices = np.empty(16 * count, np.float32)
    instances.foreach_get("matrix_world", matrices)
    random_ids = np.empty(count, np.int32)
    instances.foreach_get("random_id", random_ids)
    found = Pass(matrices.reshape(count, 4, 4).transpose(0, 2, 1), random_ids, {}, [], {})
    if has_ids:
        found.ids = np.empty((count, 9), np.int32)
        persistent = np.empty(8 * count, np.int32)
        instances.foreach_get("persistent_id", persistent)
        # The random number stands for the names of the object and of what makes the instance.
        found.ids[:, 0], found.ids[:, 1:] = random_ids, persistent.reshape(count, 8)
    by_data: dict[tuple[int, int, bool], Group | None] = {}
    mesh_keys: dict[str, int] = {}
    for row, instance in enumerate(instances):
        item = instance.object
        if instance.show_particles and not instance.is_instance and (is_shown is None or is_shown(item)):
            _gather_hair(found, item, row)
        if not instance.show_self:
            continue
        kind = item.type
        if kind in ("MESH", "CURVES"):
            data = item.data
            is_instance = instance.is_instance
            place = (item.original.as_pointer(), data.as_pointer(), is_instance)
            if place not in by_data:
                shown = is_shown is None or is_shown(item)
                by_data[place] = _group(depsgraph, found, mesh_keys, item, data, is_instance) if shown else None
            group = by_data[place]
            if group is not None:
                group.rows.append(row)
        elif kind == "LIGHT":
            if is_shown is None or is_shown(item):
                key = f"light {uid_of(item.original)} {_persistent(instance)}"
                lasting = item.original.evaluated_get(depsgraph) if instance.is_instance else item
                found.lights.append((key, lasting, row))
        elif kind == "VOLUME":
            if is_shown is None or is_shown(item):
                lasting = item.original.evaluated_get(depsgraph) if instance.is_instance else item
                found.volumes.append((f"volume {uid_of(item.original)} {_persistent(instance)}", lasting, row))
        elif kind in ("POINTCLOUD", "GREASEPENCIL"):
            found.skipped[item.name] = {"POINTCLOUD": "point clouds are"}.get(kind, f"{kind.lower()} objects are")
    return found


def placeable(matrices: Any, bounds: Any) -> Any:
    """Returns which matrices, (..., 4, 4), can be inverted and place a box, (8, 3), where the renderer can compute with it."""
    with np.errstate(all="ignore"):
        precise = matrices.astype(np.float64)
        sizes = np.abs(np.linalg.det(precise[..., :3, :3]))
        # The box of a mesh with vertices that are no numbers says nothing.
        corners = np.abs(bounds)
        reach = float(corners[corners < FARTHEST].max(initial=0.0))
        far = (np.abs(precise[..., :3, :3]).sum(-1) * reach + np.abs(precise[..., :3, 3])).max(-1)
        return np.isfinite(sizes) & (sizes > 1e-24) & (far < FARTHEST)


def parents_of(depsgraph: Any) -> dict[int, tuple[Any, Any]]:
    """Returns, by row of an instance, the object that makes it, and its particle system or `None`."""
    every = enumerate(depsgraph.object_instances)
    return {row: (instance.parent, instance.particle_system) for row, instance in every if instance.is_instance}


def _gather_hair(found: Pass, item: Any, row: int) -> None:
    """Adds the hair of an object's particle systems."""
    for index, system in enumerate(getattr(item, "particle_systems", ())):
        settings = system.settings
        if settings.type != "HAIR" or settings.render_type != "PATH":
            continue
        owner = uid_of(item.original)
        materials = [slot.material for slot in item.material_slots]
        slot = min(max(settings.material - 1, 0), len(materials) - 1)
        bounds = np.array([tuple(corner) for corner in item.bound_box])
        key, mesh_key = f"object {owner} hair {index}", f"hair of {owner} {index}"
        slots = [materials[slot]] if materials else [None]
        where = (key, mesh_key, owner, uid_of(settings.original), system, slots, visibility_of(item), item, False, bounds)
        found.groups[key] = Group(*where, "PARTICLES", [row])


def _persistent(instance: Any) -> str:
    if not instance.is_instance:
        return ""
    parent = uid_of(instance.parent.original) if instance.parent is not None else ""
    return f"{parent} {','.join(str(number) for number in instance.persistent_id if number != 0x7FFFFFFF)}"


def _group(depsgraph: Any, found: Pass, mesh_keys: dict[str, int], item: Any, data: Any, is_instance: bool) -> Group:
    # Before 4.2 a mesh that modifiers have made has no original.
    original = item.original.data if item.original.type == "MESH" else data.original
    owner, data_owner = uid_of(item.original), uid_of(original)
    # Objects without modifiers share the mesh of their data.
    pointer = data.as_pointer()
    mesh_key = f"mesh {data_owner}"
    changes_mesh = len(item.modifiers) > 0 or item.original.type != "MESH"
    if changes_mesh or mesh_keys.get(mesh_key, pointer) != pointer:
        index = 0
        mesh_key = f"mesh of {owner} {index}"
        while mesh_keys.get(mesh_key, pointer) != pointer:
            index += 1
            mesh_key = f"mesh of {owner} {index}"
    mesh_keys[mesh_key] = pointer
    key = f"object {owner} {'instances' if is_instance else ''} {mesh_key}"
    # The object of an instance is Blender's only until the next one.
    lasting = item.original.evaluated_get(depsgraph) if is_instance else item
    bounds = np.array([tuple(corner) for corner in item.bound_box])
    slots, visibility = _slots(item, data), visibility_of(item)
    group = Group(key, mesh_key, owner, data_owner, data, slots, visibility, lasting, is_instance, bounds, item.type)
    found.groups[key] = group
    return group


def _slots(item: Any, data: Any) -> list[Any]:
    """Returns the materials by slot: those linked to the object go before the mesh's."""
    materials: list[Any] = list(data.materials)
    slots = item.material_slots
    for index, slot in enumerate(slots):
        if slot.link == "OBJECT":
            materials += [None] * (index + 1 - len(materials))
            materials[index] = slot.material
    return materials or [None]


def materials_of(groups: Iterable[Group]) -> dict[Any, Any]:
    """Returns the materials of groups by session number."""
    return {uid_of(material.original): material for group in groups for material in group.slots if material is not None}
