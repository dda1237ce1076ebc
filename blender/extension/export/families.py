# SPDX-License-Identifier: GPL-3.0-or-later
"""Families of materials: what one material of Blender becomes for different kinds of ray, and for objects with different values."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import Any, Iterable

import bottega
import bpy

from .context import BOUNCES, RAYS, Context
from .materials import MadeMaterial, MaterialMaker
from .report import Fidelity, Report
from .textures import Pictures

DEFAULT = "default material"


def default_material() -> bottega.Material:
    """Returns the material of surfaces that have none: Cycles' default surface is a Principled BSDF since 5.0, a matte one before."""
    if bpy.app.version < (5, 0, 0):
        return bottega.Material.matte(0.8)
    return bottega.Material(bottega.Layered(base_color=(0.8, 0.8, 0.8), roughness=0.5, ior=1.5))


@dataclass
class Family:
    """The materials that one material of Blender becomes.

    - `asks`: what their values depend on: `ray`, and names of values of `Context`.
    - `uv_names`: the sets of texture coordinates of all of them.
    - `keys`: keys in the scene by context; contexts with equal materials share one. `made`: the materials by key.
    - `media`: media with their keys. `uses`: session numbers of images and node groups.
    """

    name: str
    asks: set[str] = field(default_factory=set)
    uv_names: list[str | None] = field(default_factory=list)
    color_name: str | None = None
    keys: dict[Context, str] = field(default_factory=dict)
    made: dict[str, MadeMaterial] = field(default_factory=dict)
    media: list[tuple[bottega.Medium, str]] = field(default_factory=list)
    uses: set[Any] = field(default_factory=set)
    is_moving: bool = False
    wanted: set[Context] = field(default_factory=set)

    def relevant(self, context: Context) -> Context:
        """Returns a context without what the materials do not depend on."""
        values = tuple((name, value) for name, value in context.values if name in self.asks)
        return Context(context.ray if "ray" in self.asks else "camera", values)


class Families:
    """The families of a scene, by session number of the material.

    `scene`: gets images, media and materials. Keys of materials are `material UID …`.
    """

    def __init__(self, scene: bottega.Scene, report: Report, pictures: Pictures) -> None:
        self.by_uid: dict[Any, Family] = {}
        self._blocks: dict[Any, Any] = {}
        self._scene, self._report, self._pictures = scene, report, pictures

    def begin(self, materials: dict[Any, Any], dirty: set[Any]) -> None:
        """Begins a pass over the evaluated materials in use: reads those that are new or have changed."""
        self._blocks = materials
        for uid, material in materials.items():
            if uid not in self.by_uid or uid in dirty:
                self.by_uid[uid] = self._learned(uid, material)

    def begin_round(self) -> None:
        """Forgets which contexts were requested."""
        for family in self.by_uid.values():
            family.wanted.clear()

    def _learned(self, uid: Any, material: Any) -> Family:
        """Reads a material once to learn what it depends on; if on nothing, that is its only one."""
        self._report.forget(f"values {uid}")
        family, report = Family(material.name), Report()
        key = _key(uid, Context())
        made = MaterialMaker(self._pictures, report, key, material.name, Context(), family.uv_names).make(material)
        family.asks = made.asks
        if not made.asks:
            self._report.begin(key)
            self._report.notes[key] = report.notes.get(key, [])
            self._put(family, uid, key, made)
            family.keys[Context()] = key
        return family

    def key(self, uid: Any, context: Context) -> str:
        """Returns the key of the material for a context, which is read now if it was not. `asks` of the family may grow by it."""
        family, material = self.by_uid[uid], self._blocks[uid]
        relevant = family.relevant(context)
        family.wanted.add(relevant)
        if relevant not in family.keys:
            key = _key(uid, relevant)
            self._report.begin(key)
            made = MaterialMaker(self._pictures, self._report, key, material.name, relevant, family.uv_names).make(material)
            family.asks |= made.asks
            family.keys[relevant] = self._shared(family, relevant, made) or key
            if family.keys[relevant] == key:
                self._put(family, uid, key, made)
        return family.keys[relevant]

    def _shared(self, family: Family, context: Context, made: MadeMaterial) -> str | None:
        """Returns the key of an equal material for another kind of ray; `None`: there is none."""
        others = (key for other, key in family.keys.items() if other.values == context.values and other.ray != context.ray)
        return next((key for key in others if family.made[key].looks == made.looks), None)

    def _put(self, family: Family, uid: Any, key: str, made: MadeMaterial) -> None:
        """Puts a material into the scene, with its images and its medium."""
        put_images(self._scene, self._pictures, made.images)
        if made.medium is not None:
            medium = next((name for one, name in family.media if one == made.medium), None)
            if medium is None:
                medium = f"medium {key}"
                family.media.append((made.medium, medium))
                self._scene.media[medium] = made.medium
            made.material.interior = medium
        self._scene.materials[key] = made.material
        family.made[key] = made
        family.uses |= made.uses
        family.is_moving |= made.is_moving
        family.color_name = made.color_name if family.color_name is None else family.color_name

    def end(self) -> None:
        """Notes what differs from Cycles between kinds of ray, and forgets contexts that were not requested. Materials stay until `drop`."""
        for uid in self._blocks:
            family = self.by_uid[uid]
            for context in [context for context in family.keys if context not in family.wanted]:
                key = family.keys.pop(context)
                self._report.forget(_key(uid, context))
                if key not in family.keys.values():
                    del family.made[key]
            self._note_lights(uid, family)

    def _note_lights(self, uid: Any, family: Family) -> None:
        if "ray" not in family.asks or not family.made:
            return
        emissions: dict[Any, list[Any]] = {}
        for context, key in family.keys.items():
            if context.ray in BOUNCES:
                emissions.setdefault(context.values, []).append(family.made[key].material.emission)
        if any(one != all_[0] for all_ in emissions.values() for one in all_):
            text = "light that differs by kind of ray is exact; Cycles takes that of no kind where it aims at lights"
            self._report.add(next(iter(family.made)), family.name, "Light Path", Fidelity.APPROXIMATED, text)

    def drop(self) -> None:
        """Removes the materials, media and images from the scene that nothing uses any longer."""
        scene = self._scene
        for uid in [uid for uid in self.by_uid if uid not in self._blocks]:
            del self.by_uid[uid]
            self._report.forget(f"values {uid}")
        materials, media = set(self.material_keys()), set(self.media_keys())
        for key in scene.materials.keys():
            if key.startswith("material ") and key not in materials:
                del scene.materials[key]
                self._report.forget(key)
        for key in scene.media.keys():
            if key.startswith("medium ") and key not in media:
                del scene.media[key]
        for family in self.by_uid.values():
            family.media = [(medium, key) for medium, key in family.media if key in media]

    def material_keys(self) -> list[str]:
        """Returns the keys of all materials, in the order of use."""
        return [key for family in self._ordered() for key in dict.fromkeys(family.keys[context] for context in _sorted(family.keys))]

    def media_keys(self) -> list[str]:
        """Returns the keys of all media that materials use, in the order of use."""
        interiors = (made.material.interior for made in self._made())
        return list(dict.fromkeys(interior for interior in interiors if interior is not None))

    def image_keys(self) -> list[str]:
        """Returns the keys of all images of materials, in the order of use."""
        return list(dict.fromkeys(key for made in self._made() for key in made.images))

    def materials(self) -> list[bottega.Material]:
        """Returns all materials."""
        return [made.material for made in self._made()]

    def _made(self) -> Iterable[MadeMaterial]:
        return (family.made[key] for family in self._ordered() for key in dict.fromkeys(family.keys[context] for context in _sorted(family.keys)))

    def _ordered(self) -> Iterable[Family]:
        return (self.by_uid[uid] for uid in self._blocks)


def put_images(scene: bottega.Scene, pictures: Pictures, images: dict[str, Any]) -> None:
    """Puts images into a scene that it lacks, or whose pixels were read again."""
    for key, image in images.items():
        if key not in scene.images or key in pictures.loaded:
            scene.images[key] = image()


def _sorted(contexts: Iterable[Context]) -> list[Context]:
    """Returns contexts in an order that does not depend on the edits before."""
    return sorted(contexts, key=lambda context: (context.values, RAYS.index(context.ray)))


def _key(uid: Any, context: Context) -> str:
    if context == Context():
        return f"material {uid}"
    return f"material {uid} {context.ray} {hashlib.sha256(repr(context.values).encode()).hexdigest()[:16]}"
