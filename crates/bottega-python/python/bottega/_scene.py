"""Scenes in memory: everything has a key, and is added, replaced, moved, hidden and removed by it."""

from __future__ import annotations

import json
import os
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Generic, Iterator, Literal, Sequence, TypeVar, Union

from . import _native
from ._errors import RenderWarning, SceneError
from ._lights import Camera, Environment, Light, Sphere, light_of_plain
from ._materials import Material, Medium
from ._requests import Request
from ._values import Value, Visibility

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ._lights import Matrix, Vector

    Floats = NDArray[np.float32]
    Ints = NDArray[np.int32]

T = TypeVar("T")
V = TypeVar("V", bound=Value)
Keys = Union[str, Sequence[str]]


@dataclass
class Mesh:
    """Triangles whose normals, texture coordinates and colors belong to corners. Arrays are contiguous, and are read without a copy.

    - `positions`: float32, (V, 3), in object space. Right-handed, +y up.
    - `triangles`: int32, (T, 3), corners, counter-clockwise seen from the front.
    - `corner_vertices`: int32, (C,), the vertex of each corner; `None`: corner i is vertex i.
    - `normals`: float32, (C, 3); `None`: faces are flat. `uvs`, `uvs2`: float32, (C, 2), two sets of texture coordinates.
    - `colors`: float32, (C, 4), linear R G B A, which multiply the color of a layered material.
    - `materials`: key, or keys by slot; `triangle_materials`: int32, (T,), the slot of each triangle; `None`: slot 0. Without a key a
      slot is gray.
    - `drop_empty`: leave out triangles without area, which are an error otherwise.
    - `motion`: keys of vertices that move while the shutter of the scene is open: (time, positions) or (time, positions, normals), with
      as many rows as the mesh has, at times that ascend. Between two keys vertices move straight.

    Corners of a vertex with equal values become one vertex.
    """

    positions: Floats
    triangles: Ints
    corner_vertices: Ints | None = None
    normals: Floats | None = None
    uvs: Floats | None = None
    uvs2: Floats | None = None
    colors: Floats | None = None
    materials: Keys = ()
    triangle_materials: Ints | None = None
    drop_empty: bool = False
    motion: Sequence[tuple[Any, ...]] = ()


@dataclass
class Curves:
    """Hair, fur or grass: curves that are straight between their points. They are put among the meshes of a scene.

    - `points`: float32, (P, 3), in object space, one curve after another. `counts`: int32, (K,), the number of points of each curve, at
      least 2; their sum is P.
    - `radii`: float32, (P,), half the width at each point.
    - `shape`: `round`: tubes without an inside; `flat`: ribbons that face each ray.
    - `material`: key; `None`: gray.
    - `drop_empty`: leave out curves without length, which are an error otherwise.
    """

    points: Floats
    counts: Ints
    radii: Floats
    shape: Literal["round", "flat"] = "round"
    material: str | None = None
    drop_empty: bool = False


@dataclass
class Object:
    """A mesh placed in the world, once or many times.

    - `mesh`: its key.
    - `transforms`: (4, 4), (N, 4, 4) or (N, 3, 4), from object to world space, for column vectors; may mirror. `None`: one at its place.
    - `materials`: keys in place of the mesh's, by slot.
    - `instance_materials`: int32, (N,), the material of each instance, as an index into `materials`, for all of its slots.
    - `hidden`: it is not in the picture. `visibility`: the kinds of ray for which it is there; `None`: all.
    - `motion`: keys of its path while the shutter of the scene is open: (time, transforms), at times that ascend. Between two keys it is
      shifted, turned and stretched evenly, and turned by less than half a turn.
    """

    mesh: str
    transforms: ArrayLike | None = None
    materials: Keys = ()
    instance_materials: Ints | None = None
    hidden: bool = False
    visibility: Visibility | None = None
    motion: Sequence[tuple[float, ArrayLike]] = ()


@dataclass
class Image:
    """An image for textures and environments; row 0 is the upper row.

    - `pixels`: uint8, uint16 or float32, (height, width) or (height, width, 1, 3 or 4), contiguous.
    - `color_space`: `srgb`: colors are encoded as sRGB; `linear`: linear Rec. 709; `data`: numbers that are not colors, such as normals and
      heights.
    """

    pixels: NDArray[Any]
    color_space: Literal["srgb", "linear", "data"] = "srgb"


@dataclass(frozen=True)
class ImageSize:
    """Columns and rows of an image in a scene."""

    width: int
    height: int


class Collection(Generic[T]):
    """The things of one kind in a scene, by key, in the order in which they were added."""

    def __init__(self, scene: Scene, kind: str) -> None:
        self._scene, self._kind = scene, kind

    @property
    def _native(self) -> _native.Scene:
        return self._scene._native

    def keys(self) -> list[str]:
        """Returns all keys."""
        return self._native.keys(self._kind)

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def __len__(self) -> int:
        return self._native.count(self._kind)

    def __contains__(self, key: object) -> bool:
        return isinstance(key, str) and self._native.contains(self._kind, key)

    def add(self, key: str, value: T) -> None:
        """Adds a thing under a new key. Raises `SceneError` if the key is used already."""
        self._put(key, value, True)

    def __setitem__(self, key: str, value: T) -> None:
        """Adds a thing, or replaces the one that has the key."""
        self._put(key, value, False)

    def __delitem__(self, key: str) -> None:
        """Removes a thing. Raises `SceneError` if another one refers to it."""
        self._native.remove(self._kind, key)

    def hide(self, key: str, hidden: bool = True) -> None:
        """Hides an object, a sphere or a light, or shows it again."""
        self._native.hide(self._kind, key, hidden)

    def is_hidden(self, key: str) -> bool:
        """Returns true if a thing is hidden."""
        return self._native.is_hidden(self._kind, key)

    def arrange(self, keys: Sequence[str]) -> None:
        """Brings the things into the order of some keys, as if they had been added in this order; the others follow.

        A picture depends on the order: scenes with equal things in equal order give the same bits. Raises `SceneError` if a key does
        not exist.
        """
        self._native.arrange(self._kind, list(keys))

    def __repr__(self) -> str:
        return f"<{len(self)} of kind {self._kind}: {', '.join(self.keys()[:8])}>"

    def _put(self, key: str, value: T, is_new: bool) -> None:
        raise NotImplementedError

    def _check(self, value: object, *classes: type) -> None:
        if not isinstance(value, classes):
            names = " or ".join(cls.__name__ for cls in classes)
            raise SceneError(f"a {self._kind} cannot be a {type(value).__name__}: make a bottega.{names}")


class ValueCollection(Collection[V]):
    """Values by key. `collection[key].field = value` changes the scene."""

    def __init__(
        self, scene: Scene, kind: str, cls: type[V], of_plain: Callable[[dict[str, Any], Any], V] | None = None
    ) -> None:
        super().__init__(scene, kind)
        self._cls = cls
        self._of_plain = of_plain or cls.of_plain
        self._views: dict[str, V] = {}

    def __getitem__(self, key: str) -> V:
        value = self._views.get(key)
        if value is None or key not in self:
            value = self._read(key)
            value.__dict__["_changed"] = lambda: self._write(key, value, False)
            self._views[key] = value
        return value

    def __delitem__(self, key: str) -> None:
        super().__delitem__(key)
        self._forget(key)

    def _put(self, key: str, value: V, is_new: bool) -> None:
        self._check(value, self._cls)
        self._write(key, value, is_new)
        self._forget(key)

    def _forget(self, key: str) -> None:
        # What was taken out before belongs to no scene any more.
        view = self._views.pop(key, None)
        if view is not None:
            view.__dict__.pop("_changed", None)

    def _read(self, key: str) -> V:
        return self._of_plain(json.loads(self._native.get(self._kind, key)), self._native)

    def _write(self, key: str, value: V, is_new: bool) -> None:
        self._native.put(self._kind, key, json.dumps(value.plain_fields(self._native)), is_new)


class MovingCollection(ValueCollection[V]):
    """Cameras or lights, which may move."""

    def set_motion(self, key: str, keys: Sequence[tuple[float, Matrix]]) -> None:
        """Sets the path of a camera or a light while the shutter of the scene is open: (time, matrix), at times that ascend.

        The matrices of a camera are like its `transform`. Those of a light move it, in world space, from where it was put. What is put
        again, or changed, stands still until this is called again.
        """
        self._native.set_motion(self._kind, key, [(float(time), matrix) for time, matrix in keys])


class Spheres(ValueCollection[Sphere]):
    """The spheres of a scene."""

    def set_motion(self, key: str, keys: Sequence[tuple[float, Vector, float]]) -> None:
        """Sets the path of a sphere while the shutter of the scene is open: (time, center, radius), at times that ascend."""
        self._native.set_sphere_motion(key, [(float(time), tuple(center), float(radius)) for time, center, radius in keys])

    def _read(self, key: str) -> Sphere:
        text, material = self._native.sphere(key)
        plain = json.loads(text)
        visibility = Visibility.of_bits(plain["visibility"])
        return Sphere(plain["center"], plain["radius"], material, plain["world_from_object"], visibility)

    def _write(self, key: str, value: Sphere, is_new: bool) -> None:
        self._native.put_sphere(key, json.dumps(value.plain_fields(self._native)), value.material, is_new)


class Media(ValueCollection[Medium]):
    """The media of a scene."""

    def _put(self, key: str, value: Medium, is_new: bool) -> None:
        self._check(value, Medium)
        self._send(key, value, is_new, False)
        self._forget(key)

    def _write(self, key: str, value: Medium, is_new: bool) -> None:
        self._send(key, value, is_new, value.density is None and value.voxels is None)

    def _send(self, key: str, value: Medium, is_new: bool, keeps_grids: bool) -> None:
        text = json.dumps(value.plain_fields(self._native))
        grids = (value.density, value.albedo, value.emission_grid, value.transform)
        placed = None
        if value.voxels is not None:
            if value.density is not None:
                raise SceneError("`density` and `voxels` are given: one of them is needed")
            placed = (value.voxels, value.temperature_scale, value.temperature_offset, value.blackbody)
        self._native.put_medium(key, text, *grids, placed, keeps_grids, is_new)


class Images(Collection[Image]):
    """The images of a scene."""

    def __getitem__(self, key: str) -> ImageSize:
        return ImageSize(*self._native.image_size(key))

    def _put(self, key: str, value: Image, is_new: bool) -> None:
        self._check(value, Image)
        if value.color_space not in ("srgb", "linear", "data"):
            raise SceneError(f"`color_space` is {value.color_space!r}: 'srgb', 'linear' or 'data' is needed")
        self._native.put_image(key, value.pixels, value.color_space, is_new)


class PlacedMesh:
    """A mesh of a scene."""

    def __init__(self, scene: Scene, key: str) -> None:
        self._native, self._key = scene._native, key
        self._native.mesh(key)

    @property
    def vertex_count(self) -> int:
        """The number of vertices after corners with equal values were united."""
        return self._native.mesh(self._key)[0]

    @property
    def triangle_count(self) -> int:
        """The number of triangles."""
        return self._native.mesh(self._key)[1]

    @property
    def materials(self) -> list[str]:
        """Keys of the materials by slot; may be set."""
        return self._native.mesh(self._key)[2]

    @materials.setter
    def materials(self, keys: Keys) -> None:
        self._native.set_mesh_materials(self._key, _keys(keys))


class Meshes(Collection["Mesh | Curves"]):
    """The meshes of a scene, curves among them."""

    def __getitem__(self, key: str) -> PlacedMesh:
        return PlacedMesh(self._scene, key)

    def _put(self, key: str, value: Mesh | Curves, is_new: bool) -> None:
        if isinstance(value, Curves):
            if value.shape not in ("round", "flat"):
                raise SceneError(f"`shape` is {value.shape!r}: \"round\" or \"flat\"")
            materials = _keys(value.material or ())
            arrays = value.points, value.counts, value.radii
            self._native.put_curves(key, *arrays, value.shape == "round", materials, value.drop_empty, is_new)
            return
        self._check(value, Mesh, Curves)
        self._native.put_mesh(
            key,
            value.positions,
            value.triangles,
            value.corner_vertices,
            value.normals,
            value.uvs,
            value.uvs2,
            value.colors,
            value.triangle_materials,
            _keys(value.materials),
            value.drop_empty,
            is_new,
            [_mesh_key(key) for key in value.motion],
        )


class PlacedObject:
    """An object of a scene; setting a property changes the scene."""

    def __init__(self, scene: Scene, key: str) -> None:
        self._native, self._key = scene._native, key
        self._native.object(key)

    @property
    def mesh(self) -> str:
        """The key of its mesh."""
        return self._native.object(self._key)[0]

    @property
    def materials(self) -> list[str]:
        """Keys of its own materials by slot; may be set."""
        return self._native.object(self._key)[1]

    @materials.setter
    def materials(self, keys: Keys) -> None:
        self._native.set_object_materials(self._key, _keys(keys))

    @property
    def transforms(self) -> Floats:
        """The matrices of its instances: float32, (N, 4, 4), a copy; may be set, also to a single matrix or to (N, 3, 4)."""
        return self._native.transforms(self._key)

    @transforms.setter
    def transforms(self, matrices: ArrayLike) -> None:
        self._native.move_object(self._key, matrices)

    def set_motion(self, keys: Sequence[tuple[float, ArrayLike]]) -> None:
        """Sets its path while the shutter is open; see `Object`. No keys: it stands still, as it does after a change of `transforms`."""
        self._native.set_object_motion(self._key, [(float(time), matrices) for time, matrices in keys])

    @property
    def hidden(self) -> bool:
        """True if it is not in the picture; may be set."""
        return self._native.is_hidden("object", self._key)

    @hidden.setter
    def hidden(self, hidden: bool) -> None:
        self._native.hide("object", self._key, hidden)

    @property
    def visibility(self) -> Visibility:
        """The kinds of ray for which it is there; it, or a field of it, may be set."""
        made = Visibility.of_bits(self._native.object_visibility(self._key))
        made.__dict__["_changed"] = lambda: self._native.set_object_visibility(self._key, made.bits)
        return made

    @visibility.setter
    def visibility(self, visibility: Visibility) -> None:
        if not isinstance(visibility, Visibility):
            raise SceneError(f"`visibility` is a {type(visibility).__name__}: make a bottega.Visibility")
        self._native.set_object_visibility(self._key, visibility.bits)


class Objects(Collection[Object]):
    """The objects of a scene."""

    def __getitem__(self, key: str) -> PlacedObject:
        return PlacedObject(self._scene, key)

    def _put(self, key: str, value: Object, is_new: bool) -> None:
        self._check(value, Object)
        transforms = _IDENTITY if value.transforms is None else value.transforms
        materials = _keys(value.materials)
        visibility = Visibility() if value.visibility is None else value.visibility
        self._native.put_object(
            key, value.mesh, transforms, materials, value.instance_materials, value.hidden, visibility.bits, is_new
        )
        if value.motion:
            self[key].set_motion(value.motion)


_IDENTITY = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))


class Scene:
    """A scene in memory, which sessions and viewports render as it is when they begin, or when `update` is called.

    Coordinates are right-handed, +y up; the front of a face is the side from which its corners run counter-clockwise. Colors are linear
    R G B (Rec. 709). Every edit either holds as a whole or raises `SceneError`, which names the argument, the row and the remedy, and
    changes nothing. A picture depends on what is in the scene and on the order in which keys were added (or `arrange`d), not on the edits before.
    """

    def __init__(self) -> None:
        self._set(_native.Scene())

    def _set(self, native: _native.Scene) -> None:
        self._native = native
        self.images = Images(self, "image")
        self.media = Media(self, "medium", Medium)
        self.materials: ValueCollection[Material] = ValueCollection(self, "material", Material)
        self.meshes = Meshes(self, "mesh")
        self.objects = Objects(self, "object")
        self.spheres = Spheres(self, "sphere", Sphere)
        self.lights: MovingCollection[Light] = MovingCollection(self, "light", Light, light_of_plain)
        self.cameras: MovingCollection[Camera] = MovingCollection(self, "camera", Camera)
        self._environment: Environment | None = None

    @classmethod
    def read(cls, file: str | os.PathLike[str], **options: Any) -> Scene:
        """Reads a scene file, to be edited. Keys are the names of the file, made unique by a number. Unchanged, it renders to the bits
        of the file.

        `options` are the fields of `SceneOptions`, such as `variant` and `strict`. Warnings are `RenderWarning`.
        """
        request = Request.of(file)
        for name, value in options.items():
            setattr(request.scene, name, value)
        native, notes = _native.Scene.read(request.to_json())
        for note in notes:
            warnings.warn(note, RenderWarning, 2)
        scene = cls.__new__(cls)
        scene._set(native)
        return scene

    def save(
        self,
        file: str | os.PathLike[str],
        *,
        size: tuple[int, int] | None = None,
        spp: int | None = None,
        max_depth: int | None = None,
    ) -> None:
        """Writes the scene as it is now to a file of Bottega's own format (`.bottega`), completely or not at all.

        `Scene.read`, `bottega render` and a farm read it, and it renders to the same bits. Keys become names; what is hidden is left out.
        `size`, `spp` and `max_depth` are used where a request does not say otherwise; `None`: those of the file that the scene was read
        from. Raises `PictureError` if the file cannot be written.
        """
        self._native.save(file, size, spp, max_depth)

    @property
    def environment(self) -> Environment | None:
        """Radiance along rays that leave the scene; `None`: black. Setting it, or a field of it, changes the scene."""
        plain = json.loads(self._native.environment())
        if plain is None:
            return None
        if self._environment is None:
            made = Environment.of_plain(plain, self._native)
            made.__dict__["_changed"] = lambda: self._write_environment(made)
            self._environment = made
        return self._environment

    @environment.setter
    def environment(self, environment: Environment | None) -> None:
        if environment is not None and not isinstance(environment, Environment):
            raise SceneError(f"`environment` is a {type(environment).__name__}: make a bottega.Environment, or None")
        self._write_environment(environment)
        if self._environment is not None:
            self._environment.__dict__.pop("_changed", None)
        self._environment = None

    def _write_environment(self, environment: Environment | None) -> None:
        plain = None if environment is None else environment.plain_fields(self._native)
        self._native.set_environment(json.dumps(plain))

    @property
    def shutter(self) -> tuple[float, float, float]:
        """The span of time that pictures show: when the shutter opens and is closed, and the share of that time, from 0 to 0.5, that it
        takes to open and to close. May be set, also to two numbers; at first it is closed, and nothing is blurred."""
        return self._native.shutter()

    @shutter.setter
    def shutter(self, times: Sequence[float]) -> None:
        if len(times) not in (2, 3):
            raise SceneError(f"`shutter` has {len(times)} numbers: when it opens and closes, and perhaps a ramp")
        self._native.set_shutter(*(float(time) for time in times))

    @property
    def triangle_count(self) -> int:
        """The number of triangles that are shown, once per instance."""
        return self._native.triangle_count()

    def __repr__(self) -> str:
        counts = f"{len(self.objects)} objects, {self.triangle_count} triangles, {len(self.cameras)} cameras"
        return f"<bottega.Scene of {counts}>"


def _mesh_key(key: tuple[Any, ...]) -> tuple[float, Floats, Floats | None]:
    if len(key) not in (2, 3):
        raise SceneError(f"a key of `motion` has {len(key)} members: a time and positions, and perhaps normals")
    return float(key[0]), key[1], key[2] if len(key) == 3 else None


def _keys(keys: Keys) -> list[str]:
    members = [keys] if isinstance(keys, str) else list(keys)
    for key in members:
        if not isinstance(key, str):
            raise SceneError(f"`materials` has {key!r}: keys of materials are needed; add a material, and give its key")
    return members
