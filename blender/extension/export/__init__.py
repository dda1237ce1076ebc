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
from .deform import moving_mesh, velocity_keys
from .families import DEFAULT, Families, default_material, put_images
from .hair import shape_of_hair, strands_of_curves, strands_of_particles
from .instances import Group, Pass, gather, materials_of, placeable
from .light_groups import light_groups_of
from .lights import light_of
from .meshes import MeshArrays, Shape, arrays_of, velocities_of
from .moments import Motion
from .nodes import groups_of, uid_of
from .paths import Path, Paths, is_same_path
from .placements import Placement, placements_of
from .report import Fidelity, Report
from .shadow_catchers import shadow_catchers_of
from .textures import Pictures
from .volumes import BOX, Volumes, is_gas_domain
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
        self._volumes = Volumes(self.scene, self.report)
        self._is_clear = False
        # Of the evaluated scene: `VIEWPORT` or `RENDER`.
        self._mode = "RENDER"
        self._mesh_states: dict[str, tuple[Any, ...]] = {}
        # Meshes whose vertices move while the shutter is open.
        self._deforming: set[str] = set()
        self._lights_put: dict[str, bottega.Light] = {}
        self._light_paths: dict[str, Path | None] = {}
        # Keys of the pictures of lights.
        self._light_images: dict[str, str | None] = {}
        # Of the last pass, until it is dropped; `None`: nothing moves while the shutter is open.
        self.paths: Paths | None = None
        # How long the shutter is open, in seconds.
        self._exposure = 0.0
        self._placed: dict[str, tuple[Any, ...]] = {}
        self._world_uses: set[Any] = set()
        # Names of the lights of each light group.
        self.light_groups: dict[str, list[str]] = {}
        # Names of the meshes of shadow catchers.
        self.shadow_catchers: list[str] = []
        self._is_world_moving = False
        # Session numbers of what Blender has changed since the last pass.
        self._dirty: set[Any] = set()
        self._dirty_world = True
        self.scene.materials[DEFAULT] = default_material()

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

    def update(
        self, depsgraph: Any, is_shown: Callable[[Any], bool] | None = None, is_clear: bool = False, motion: Motion | None = None
    ) -> None:
        """Brings the scene to the state of an evaluated scene.

        - `is_shown`: called with an evaluated object; `None`: all are shown.
        - `is_clear`: the film is transparent: the camera does not see the world.
        - `motion`: what moves while the shutter is open; the scene is evaluated at the middle of that time. `None`: nothing.
        """
        self._mode = depsgraph.mode
        self._move_to(depsgraph.scene.frame_current if motion is None else motion.frame)
        found = gather(depsgraph, is_shown, has_ids=motion is not None)
        self._open_shutter(depsgraph, found, motion)
        self._world(depsgraph.scene.world, is_clear)
        self._families.begin(materials_of(found.groups.values()), self._dirty)
        placements = placements_of(depsgraph, found, self._families, self.report)
        self._families.end()
        self._read_meshes(found)
        self._place(found, placements)
        self._read_lights(found)
        self._volumes.update(found.volumes, found.matrices, self._dirty)
        self._surround(found, placements)
        self._drop_unused(found, placements)
        self.shadow_catchers = shadow_catchers_of(found, depsgraph.scene, self.report)
        self.light_groups = light_groups_of(found, depsgraph.scene.world, self._surroundings.lights, self.report)
        self._dirty.clear()
        self._arrange(found, placements)
        self.report.begin("objects")
        for name, text in found.skipped.items():
            self.report.add("objects", name, "Object", Fidelity.LEFT_OUT, f"{text} left out")
        for group in found.groups.values():
            if is_gas_domain(group.item):
                text = "smoke of a fluid domain is rendered as even fog: bake it as OpenVDB, and add its files as a volume object"
                self.report.add("objects", group.item.name, "Fluid", Fidelity.LEFT_OUT, text)
        # Pixels that textures hold are not needed twice.
        self._pictures.loaded.clear()

    def _open_shutter(self, depsgraph: Any, found: Pass, motion: Motion | None) -> None:
        """Sets the span of time that pictures show, and prepares the paths of what moves meanwhile."""
        if motion is None:
            self.scene.shutter, self.paths, self._exposure = (0.0, 0.0), None, 0.0
            return
        shutter, render = motion.shutter, depsgraph.scene.render
        self.scene.shutter = (shutter.open, shutter.close, shutter.ramp)
        self._exposure = (shutter.close - shutter.open) * render.fps_base / render.fps
        self.paths = Paths(motion, found, depsgraph)

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
            is_deforming = group.mesh_key in self._deforming or self._may_deform(group)
            if self._mesh_states.get(group.mesh_key) == state and not is_dirty and not is_deforming:
                continue
            self._mesh_states[group.mesh_key] = state
            self.report.begin(group.mesh_key)
            if not self._put_mesh(group, uv_names, color_name) and group.mesh_key in self.scene.meshes:
                self._remove_objects_of(group.mesh_key)
                del self.scene.meshes[group.mesh_key]

    def _may_deform(self, group: Group) -> bool:
        """Returns true if the vertices of a mesh may move while the shutter is open."""
        if self.paths is None or not self.paths.deforms(group):
            return False
        return len(self.paths.shapes_of(group)) > 0 or (group.kind == "MESH" and group.data.attributes.get("velocity") is not None)

    def _put_mesh(self, group: Group, uv_names: list[str | None], color_name: str | None) -> bool:
        """Reads a mesh or hair. Returns false if nothing of it can be seen."""
        self._deforming.discard(group.mesh_key)
        if group.kind != "MESH":
            made = self._read_hair(group)
            return made is not None and self._put_shape(group, made)
        arrays = arrays_of(group.data, tuple(uv_names), color_name)
        if arrays is None:
            return False
        materials = [DEFAULT] * max(arrays.slot_count, len(group.slots))
        keys = self._keys_of(group, arrays)
        if keys and self._put_shape(group, moving_mesh(arrays, keys, materials)):
            self._deforming.add(group.mesh_key)
            return True
        return self._put_shape(group, arrays.to_mesh(materials))

    def _put_shape(self, group: Group, made: bottega.Mesh | bottega.Curves) -> bool:
        try:
            self.scene.meshes[group.mesh_key] = made
        except bottega.SceneError as error:
            self.report.add(group.mesh_key, group.data.name, "Mesh" if group.kind == "MESH" else "Hair", Fidelity.LEFT_OUT, str(error))
            return False
        return True

    def _read_hair(self, group: Group) -> bottega.Curves | None:
        """Reads hair; `None`: nothing of it can be seen."""
        if self.paths is not None and self.paths.hair_changes(group, shape_of_hair(group.kind, group.item, group.data)):
            text = "hair does not bend while the shutter is open; it moves with its object"
            self.report.add(group.mesh_key, group.item.name, "Motion Blur", Fidelity.LEFT_OUT, text)
        if group.kind == "PARTICLES":
            strands = strands_of_particles(group.item, group.data, self._mode == "VIEWPORT")
        else:
            strands = strands_of_curves(group.data)
        return None if strands is None else strands.to_curves(DEFAULT)

    def _keys_of(self, group: Group, arrays: MeshArrays) -> list[tuple[float, Shape]]:
        """Returns the keys of a mesh's vertices; empty: they do not move."""
        paths = self.paths
        if paths is None or not paths.deforms(group):
            return []
        velocities = velocities_of(group.data)
        if velocities is not None and len(velocities) == len(arrays.positions):
            return velocity_keys(arrays, velocities, self._exposure, paths.shutter.open, paths.shutter.close)
        here = Shape(arrays.positions, arrays.normals, arrays.corner_vertices)
        others = paths.shapes_of(group)
        if all(shape.equals(here) for _, shape in others):
            return []
        if not all(shape.fits(here) and np.isfinite(shape.positions).all() for _, shape in others):
            text = "its vertices or faces change while the shutter is open; it moves without changing its shape"
            self.report.add(group.mesh_key, group.item.name, "Motion Blur", Fidelity.LEFT_OUT, text)
            return []
        return sorted([*others, (paths.shutter.middle, here)], key=lambda key: key[0])

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
            rows = self._regular(found, placement)
            if len(rows) == 0:
                self._remove_object(key)
                continue
            transforms = np.ascontiguousarray(axes.TURN.astype(np.float32) @ found.matrices[rows])
            path = None if self.paths is None else self.paths.of_instances(group, rows)
            before = self._placed.get(key)
            what = (group.mesh_key, materials, placement.visibility)
            moved = True
            if before is not None and before[:3] == what:
                moved = len(before[3]) != len(transforms) or not np.array_equal(before[3], transforms)
                if moved:
                    self.scene.objects[key].transforms = transforms
                moved = moved or not is_same_path(before[4], path)
            else:
                self.scene.objects[key] = bottega.Object(group.mesh_key, transforms, materials, visibility=placement.visibility)
            if moved:
                self.scene.objects[key].set_motion([] if path is None else path.keys())
            self._placed[key] = (*what, transforms, path)

    def _regular(self, found: Pass, placement: Placement) -> Any:
        """Returns the rows of a placement that can be placed, and notes the others."""
        key, group, rows = placement.key, placement.group, np.array(placement.rows)
        good = placeable(found.matrices[rows], group.bounds)
        if not good.all():
            text = f"{int((~good).sum())} instances whose scale is 0, or that reach too far, are left out"
            self.report.add(key, group.data.name, "Scale", Fidelity.LEFT_OUT, text)
        else:
            self.report.forget(key)
        if self.paths is not None:
            good &= self.paths.lasting(group, rows)
        return rows[good]

    def _read_lights(self, found: Pass) -> None:
        for key, light, row in found.lights:
            self.report.begin(key)
            made, picture = light_of(light, found.matrices[row], key, self.report, self._pictures)
            if made is None:
                self._remove_light(key)
                continue
            if picture is not None and picture.key not in self.scene.images:
                self.scene.images[picture.key] = picture.image()
            self._light_images[key] = None if picture is None else picture.key
            path = self._light_path(key, light, row)
            if self._lights_put.get(key) != made or not is_same_path(self._light_paths.get(key), path):
                self.scene.lights[key] = made
                if path is not None:
                    self.scene.lights.set_motion(key, path.keys())
                self._lights_put[key], self._light_paths[key] = made, path

    def _light_path(self, key: str, light: Any, row: int) -> Path | None:
        """Returns the path of a light while the shutter is open, and notes that Cycles lets it stand still."""
        if self.paths is None:
            return None
        path = self.paths.of_light(light, row)
        if path is not None:
            text = "the light moves while the shutter is open; by Cycles it stands still"
            self.report.add(key, light.name, "Motion Blur", Fidelity.APPROXIMATED, text)
        return path

    def _remove_light(self, key: str) -> None:
        if key in self.scene.lights:
            del self.scene.lights[key]
        self._lights_put.pop(key, None)
        self._light_paths.pop(key, None)
        self._light_images.pop(key, None)

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
            self._deforming.discard(key)
            self.report.forget(key)
        if self._surroundings.backdrop is None and BACKDROP in scene.spheres:
            del scene.spheres[BACKDROP]
            del scene.materials[BACKDROP]
        self._families.drop()
        used = {*self._surroundings.images, *self._families.image_keys(), *self._light_images.values()}
        for key in scene.images.keys():
            if key not in used:
                del scene.images[key]

    def _arrange(self, found: Pass, placements: list[Placement]) -> None:
        """Brings all keys into the order of a fresh export, so that the picture has its bits."""
        scene, families, volumes = self.scene, self._families, self._volumes.keys()
        lights = [*self._surroundings.lights, *(key for key, _, _ in found.lights)]
        meshes = list(dict.fromkeys(group.mesh_key for group in found.groups.values()))
        pictures = [key for key in (self._light_images.get(key) for key, _, _ in found.lights) if key is not None]
        scene.images.arrange(_there(scene.images, [*self._surroundings.images, *families.image_keys(), *pictures]))
        scene.media.arrange(_there(scene.media, [*families.media_keys(), *volumes]))
        scene.materials.arrange(_there(scene.materials, [DEFAULT, BACKDROP, *families.material_keys(), *volumes]))
        scene.meshes.arrange(_there(scene.meshes, [*meshes, BOX]))
        scene.objects.arrange(_there(scene.objects, [*(placement.key for placement in placements), *volumes]))
        scene.lights.arrange(_there(scene.lights, lights))


def _there(collection: Any, keys: list[str]) -> list[str]:
    return [key for key in dict.fromkeys(keys) if key in collection]
