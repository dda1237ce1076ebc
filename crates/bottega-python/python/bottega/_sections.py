"""The base classes of requests and their sections: conversion to and from JSON, and checks."""

from __future__ import annotations

import dataclasses
import difflib
import json
import math
import numbers
import os
from typing import Any, ClassVar, Mapping, TypeVar

from . import _native
from ._errors import RequestError

S = TypeVar("S", bound="Section")
R = TypeVar("R", bound="BaseRequest")


class Section:
    """A section of a request. Unknown fields raise `AttributeError` if set, and `TypeError` if given to the constructor."""

    __slots__ = ()
    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset()

    def to_value(self) -> dict[str, Any]:
        """Returns the fields as plain values of JSON.

        Raises `RequestError` for a value that JSON cannot hold.
        """
        return _plain_fields(self, "")

    @classmethod
    def from_value(cls: type[S], value: Mapping[str, Any]) -> S:
        """Makes a section from plain values; missing fields get their defaults."""
        known = _names(cls)
        for name in value:
            if name not in known:
                raise TypeError(f"{cls.__name__} has no field `{name}`{_nearest(name, known)}")
        return cls(**{name: _typed(cls, name, member) for name, member in value.items()})


class BaseRequest(Section):
    """The methods of requests. See `Request`."""

    __slots__ = ()

    def to_json(self) -> str:
        """Checks the request and returns it as one line of JSON, with all defaults.

        Raises `RequestError`, whose `field` is the path of the wrong field.
        """
        return _native.check_request(json.dumps(self.to_value()))

    @classmethod
    def from_json(cls: type[R], text: str) -> R:
        """Reads a request from JSON and checks it.

        Raises `RequestError`, whose `field` is the path of the wrong field.
        """
        return cls.from_value(json.loads(_native.check_request(text)))

    def check(self) -> None:
        """Checks all fields, and combinations that exclude each other. Raises `RequestError`."""
        self.to_json()

    def _with(self: R, keywords: Mapping[str, str], changes: Mapping[str, Any]) -> R:
        known = _names(type(self))
        tree = self.to_value()
        # Apply sections first, so that a short name given together with its section wins.
        for name, value in sorted(changes.items(), key=lambda change: change[0] in keywords):
            if name in keywords:
                section, member = keywords[name].split(".")
                tree[section][member] = _plain(value, keywords[name])
            elif name not in known:
                raise TypeError(f"there is no field `{name}`{_nearest(name, [*keywords, *known])}")
            elif isinstance(value, (str, os.PathLike)) and "file" in _names(self._parts.get(name, Section)):
                tree[name]["file"] = os.fspath(value)
            elif isinstance(value, Mapping):
                tree[name] = {**(tree[name] or {}), **_plain(value, name)}
            else:
                tree[name] = _plain(value, name)
        return type(self).from_json(json.dumps(tree))


def _names(section: type[Section]) -> list[str]:
    return [field.name for field in dataclasses.fields(section)] if dataclasses.is_dataclass(section) else []


def _nearest(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name, known, 1)
    return f"; did you mean `{near[0]}`?" if near else f"; there are {', '.join(known)}"


def _typed(cls: type[Section], name: str, value: Any) -> Any:
    part = cls._parts.get(name)
    if part is not None and isinstance(value, Mapping):
        return part.from_value(value)
    return tuple(value) if name in cls._tuples and value is not None else value


def _plain_fields(section: Section, path: str) -> dict[str, Any]:
    return {name: _plain(getattr(section, name), f"{path}{name}") for name in _names(type(section))}


def _plain(value: Any, path: str) -> Any:
    """Converts a value to a plain value of JSON. `path` names the field in errors."""
    if isinstance(value, Section):
        return _plain_fields(value, f"{path}.")
    if value is None or isinstance(value, (str, bool)):
        return value
    if isinstance(value, os.PathLike):
        return _plain(os.fspath(value), path)
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real):
        if not math.isfinite(value):
            raise RequestError(f"`{path}` is {value}: a finite number is needed", None, path, str(value), "a finite number")
        return float(value)
    if isinstance(value, Mapping):
        return {str(name): _plain(member, f"{path}.{name}") for name, member in value.items()}
    try:
        members = list(value)
    except TypeError:
        kind = type(value).__name__
        raise RequestError(f"`{path}` is a {kind}, which JSON does not have", None, path, repr(value)) from None
    return [_plain(member, f"{path}[{index}]") for index, member in enumerate(members)]
