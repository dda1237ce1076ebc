# SPDX-License-Identifier: GPL-3.0-or-later
"""From an evaluated scene of Blender to a `bottega.Scene`.

`Export` keeps the scene between calls, so that only what has changed is read again. Nothing that points into Blender outlives a call.
"""

from __future__ import annotations

from typing import Any, Callable

import bottega
import numpy as np

from . import axes
from .backdrop import BACKDROP, extent_of, put_backdrop
from .families import DEFAULT, Families, put_images
from .hair import strands_of_curves, strands_of_particles
from .instances import Group, Pass, gather, materials_of
from .lights import light_of
from .meshes import arrays_of
from .nodes import groups_of, uid_of
from .placements import Placement, placements_of
from .report import Fidelity, Report
from .textures import Pictures
from .world import Surroundings, surroundings_of


class Export:
    """A scene in memory that follows a scene of Blender.

    - `scene`: the scene. `report`: what is not rendered as Cycles renders it.
    - `reach`: distance beyond which the camera must see; `None`: any.
    """

    def __init__(self) -> None:
        self.scene = bottega.Scene()
        self.report = Report()
        self._pictures = Pictures()
        self.reach: float | None = None
        self._families = Families(self.scene, self.report, self._pictures)
        self._surroundings = Surroundings()
        self._is_clear = False
        # Of the evaluated scene: `VIEWPORT` or `RENDER`.
        self._mode = "RENDER"
        self._mesh_states: dict[str, tuple[Any, ...]] = {}
        self._lights_put: dict[str, bottega.Light] = {}
        self._placed: dict[str, tuple[Any, ...]] = {}
        self._world_uses: set[Any] = set()
        self._is_world_moving = False
        # Session numbers of what Blender has changed since the last pass.
        self._dirty: set[Any] = set()
        self._dirty_world = True
        self.scene.materials[DEFAULT] = bottega.Material.matte(0.8)

    def mark(self, updates: Any) -> None:
        """Notes what an evaluated scene says has changed: `depsgraph.updates`."""
        for update in updates:
            block = update.id.original
            kind = block.bl_rna.identifier
            if kind in ("Object", "Mesh", "Curve", "Curves", "TextCurve", "SurfaceCurve", "MetaBall", "ParticleSettings"):
                # After an edit of a material, its objects and meshes are updated by their shading alone.
                if update.is_updated_geometry or (kind != "Object" and not update.is_updated_shading):
                    self._dirty.add(uid_of(block))
            elif kind == "Material":
                self._dirty.add(uid_of(block))
            elif kind == "World":
                self._dirty_world = True
            elif kind == "Image":
                self._pictures.changed(block)
                self._mark_users(uid_of(block))
            elif kind.endswith("NodeTree") and not block.is_embedded_data:
                # Blender names the owner of an embedded tree as well.
                self._mark_users(uid_of(block))

    def _mark_users(self, uid: Any) -> None:
        """Notes that what uses an image or a node group has changed."""
        self._dirty.update(user for user, family in self._families.by_uid.items() if uid in family.uses)
        self._dirty_world |= uid in self._world_uses

    def _move_to(self, frame: int) -> None:
        """Notes that what shows a sequence has changed, if the frame has."""
        if frame != self._pictures.frame:
            self._pictures.frame = frame
            self._dirty.update(user for user, family in self._families.by_uid.items() if family.is_moving)
            self._dirty_world |= self._is_world_moving

    def update(self, depsgraph: Any, is_shown: Callable[[Any], bool] | None = None, is_clear: bool = False) -> None:
        """Brings the scene to the state of an evaluated scene.

        - `is_shown`: called with an evaluated object; `None`: all are shown.
        - `is_clear`: the film is transparent: the camera does not see the world.
        """
        self._mode = depsgraph.mode
        self._move_to(depsgraph.scene.frame_current)
        found = gather(depsgraph, is_shown)
        self._world(depsgraph.scene.world, is_clear)
        self._families.begin(materials_of(found.groups.values()), self._dirty)
        placements = placements_of(depsgraph, found, self._families, self.report)
        self._families.end()
        self._read_meshes(found)
        self._place(found, placements)
        self._read_lights(found)
        self._surround(found, placements)
        self._drop_unused(found, placements)
        self._dirty.clear()
        self._arrange(found, placements)
        self.report.begin("objects")
        for name, text in found.skipped.items():
            self.report.add("objects", name, "Object", Fidelity.LEFT_OUT, f"{text} left out")
        # Pixels that textures hold are not needed twice.
        self._pictures.loaded.clear()

    def _world(self, world: Any, is_clear: bool) -> None:
        if not self._dirty_world and is_clear == self._is_clear:
            return
        self._pictures.begin()
        made = surroundings_of(world, self._pictures, self.report, is_clear)
        put_images(self.scene, self._pictures, made.images)
        self.scene.environment = made.environment
        self._surroundings, self._is_clear = made, is_clear
        tree = world.node_tree if world is not None else None
        self._world_uses = self._pictures.used | (groups_of(tree) if tree is not None else set())
        self._is_world_moving = self._pictures.is_moving
        self._dirty_world = False

    def _surround(self, found: Pass, placements: list[Placement]) -> None:
        """Places what surrounds the scene beside the environment."""
        made = self._surroundings
        for key, light in made.lights.items():
            if self._lights_put.get(key) != light:
                self.scene.lights[key] = light
                self._lights_put[key] = light
        self.reach = None
        if made.backdrop is not None:
            self.reach = extent_of(found)
            put_backdrop(self.scene, made.backdrop, self.reach)
        self.report.begin("film")
        if self._is_clear and any(isinstance(material.surface, bottega.Transparent) for material in self._families.materials()):
            self.report.add("film", "Film", "Transparent", Fidelity.APPROXIMATED, "behind transparent surfaces with a color alpha is 1")

    def _read_meshes(self, found: Pass) -> None:
        done: set[str] = set()
        for group in found.groups.values():
            if group.mesh_key in done:
                continue
            done.add(group.mesh_key)
            uv_names, color_name = self._needs(group)
            state = (tuple(uv_names), color_name, len(group.slots))
            is_dirty = group.owner in self._dirty or group.data_owner in self._dirty
            if self._mesh_states.get(group.mesh_key) == state and not is_dirty:
                continue
            self._mesh_states[group.mesh_key] = state
            self.report.begin(group.mesh_key)
            if not self._put_mesh(group, uv_names, color_name) and group.mesh_key in self.scene.meshes:
                self._remove_objects_of(group.mesh_key)
                del self.scene.meshes[group.mesh_key]

    def _put_mesh(self, group: Group, uv_names: list[str | None], color_name: str | None) -> bool:
        """Reads a mesh or hair. Returns false if nothing of it can be seen."""
        made = self._read_shape(group, uv_names, color_name)
        if made is None:
            return False
        try:
            self.scene.meshes[group.mesh_key] = made
        except bottega.SceneError as error:
            self.report.add(group.mesh_key, group.data.name, "Mesh" if group.kind == "MESH" else "Hair", Fidelity.LEFT_OUT, str(error))
            return False
        return True

    def _read_shape(self, group: Group, uv_names: list[str | None], color_name: str | None) -> bottega.Mesh | bottega.Curves | None:
        """Reads the arrays of a mesh or of hair; `None`: nothing of it can be seen."""
        if group.kind == "MESH":
            arrays = arrays_of(group.data, tuple(uv_names), color_name)
            return None if arrays is None else arrays.to_mesh([DEFAULT] * max(arrays.slot_count, len(group.slots)))
        if group.kind == "PARTICLES":
            strands = strands_of_particles(group.item, group.data, self._mode == "VIEWPORT")
        else:
            strands = strands_of_curves(group.data)
        return None if strands is None else strands.to_curves(DEFAULT)

    def _needs(self, group: Group) -> tuple[list[str | None], str | None]:
        """Returns the texture coordinates and the color attribute that the materials of a mesh use."""
        names: list[str | None] = []
        color = None
        for material in group.slots:
            family = self._families.by_uid.get(uid_of(material.original)) if material is not None else None
            if family is None:
                continue
            for index, name in enumerate(family.uv_names):
                if index >= len(names):
                    names.append(name)
                elif names[index] != name:
                    note = f"the mesh {group.data.name} has materials with different coordinates; those of the first are used"
                    self.report.add(f"material {uid_of(material.original)}", material.name, "UV Map", Fidelity.APPROXIMATED, note)
            color = family.color_name if color is None else color
        return names or [None], color

    def _place(self, found: Pass, placements: list[Placement]) -> None:
        for placement in placements:
            group, key, materials = placement.group, placement.key, placement.materials
            if group.mesh_key not in self.scene.meshes:
                continue
            transforms = axes.TURN.astype(np.float32) @ found.matrices[placement.rows]
            transforms = self._regular(transforms, key, group)
            if len(transforms) == 0:
                self._remove_object(key)
                continue
            before = self._placed.get(key)
            what = (group.mesh_key, materials, placement.visibility)
            if before is not None and before[:3] == what:
                if len(before[3]) != len(transforms) or not np.array_equal(before[3], transforms):
                    self.scene.objects[key].transforms = transforms
            else:
                self.scene.objects[key] = bottega.Object(group.mesh_key, transforms, materials, visibility=placement.visibility)
            self._placed[key] = (*what, transforms)

    def _regular(self, transforms: Any, key: str, group: Group) -> Any:
        """Returns the transforms that can be inverted, and notes the others."""
        with np.errstate(all="ignore"):
            sizes = np.abs(np.linalg.det(transforms[:, :3, :3].astype(np.float64)))
        good = np.isfinite(sizes) & (sizes > 1e-24)
        if not good.all():
            text = f"{int((~good).sum())} instances whose scale is 0 are left out"
            self.report.add(key, group.data.name, "Scale", Fidelity.LEFT_OUT, text)
        else:
            self.report.forget(key)
        return np.ascontiguousarray(transforms[good])

    def _read_lights(self, found: Pass) -> None:
        for key, light, row in found.lights:
            self.report.begin(key)
            made = light_of(light, found.matrices[row], key, self.report)
            if made is None:
                self._remove_light(key)
            elif self._lights_put.get(key) != made:
                self.scene.lights[key] = made
                self._lights_put[key] = made

    def _remove_light(self, key: str) -> None:
        if key in self.scene.lights:
            del self.scene.lights[key]
        self._lights_put.pop(key, None)

    def _remove_objects_of(self, mesh_key: str) -> None:
        for key in [key for key, placed in self._placed.items() if placed[0] == mesh_key]:
            self._remove_object(key)

    def _remove_object(self, key: str) -> None:
        if self._placed.pop(key, None) is not None:
            del self.scene.objects[key]

    def _drop_unused(self, found: Pass, placements: list[Placement]) -> None:
        """Removes what is no longer in the scene of Blender, users before what they use."""
        scene = self.scene
        lights = {*(key for key, _, _ in found.lights), *self._surroundings.lights}
        for key in [key for key in self._lights_put if key not in lights]:
            self._remove_light(key)
            self.report.forget(key)
        placed = {placement.key for placement in placements}
        for key in [key for key in self._placed if key not in placed]:
            self._remove_object(key)
            self.report.forget(key)
        meshes = {group.mesh_key for group in found.groups.values()}
        for key in [key for key in self._mesh_states if key not in meshes]:
            if key in scene.meshes:
                del scene.meshes[key]
            del self._mesh_states[key]
            self.report.forget(key)
        if self._surroundings.backdrop is None and BACKDROP in scene.spheres:
            del scene.spheres[BACKDROP]
            del scene.materials[BACKDROP]
        self._families.drop()
        used = {*self._surroundings.images, *self._families.image_keys()}
        for key in scene.images.keys():
            if key not in used:
                del scene.images[key]

    def _arrange(self, found: Pass, placements: list[Placement]) -> None:
        """Brings all keys into the order of a fresh export, so that the picture has its bits."""
        scene, families = self.scene, self._families
        lights = [*self._surroundings.lights, *(key for key, _, _ in found.lights)]
        meshes = list(dict.fromkeys(group.mesh_key for group in found.groups.values()))
        scene.images.arrange(_there(scene.images, [*self._surroundings.images, *families.image_keys()]))
        scene.media.arrange(_there(scene.media, families.media_keys()))
        scene.materials.arrange(_there(scene.materials, [DEFAULT, BACKDROP, *families.material_keys()]))
        scene.meshes.arrange(_there(scene.meshes, meshes))
        scene.objects.arrange(_there(scene.objects, [placement.key for placement in placements]))
        scene.lights.arrange(_there(scene.lights, lights))


def _there(collection: Any, keys: list[str]) -> list[str]:
    return [key for key in dict.fromkeys(keys) if key in collection]
