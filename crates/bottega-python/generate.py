"""Makes `python/bottega/_requests.py` from the JSON Schema of requests: `cargo xtask python-stubs` runs it.

`generate.py LIBRARY [--check]`: LIBRARY is the compiled module, which knows the schema.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import json
import pprint
import sys
import textwrap
from pathlib import Path
from typing import Any

TARGET = Path(__file__).parent / "python" / "bottega" / "_requests.py"

# Short names of the fields that are used most, for `render(scene, spp=64)`.
KEYWORDS = {
    "spp": "goal.samples",
    "samples": "goal.samples",
    "error": "goal.error",
    "time": "goal.time",
    "size": "film.size",
    "crop": "film.crop",
    "filter": "film.filter",
    "layers": "film.layers",
    "light_groups": "film.light_groups",
    "shadow_catchers": "film.shadow_catchers",
    "denoise": "film.denoise",
    "camera": "view.camera",
    "light": "environment.light",
    "method": "integrator.method",
    "max_depth": "integrator.max_depth",
    "agents": "work.agents",
    "optimization": "work.optimization",
    "threads": "devices.threads",
    "exact": "devices.exact",
    "exposure": "output.exposure",
}

HEAD = '''"""Requests as typed values. Made by `cargo xtask python-stubs` from the JSON Schema of requests; do not edit."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Mapping, Sequence, TypedDict, Union

from ._sections import BaseRequest, Section

if TYPE_CHECKING:
    from typing_extensions import Unpack
'''

OF = '''
    @classmethod
    def of(cls, scene: str | os.PathLike[str], **fields: Unpack[Fields]) -> Request:
        """A picture of a scene file; fields by their short names (`spp=64`) or by section (`goal={"samples": 64}`).

        Raises `RequestError` for a value that is not allowed, `TypeError` for a field that there is not.
        """
        return cls(scene=SceneOptions(file=os.fspath(scene))).changed(**fields)

    def changed(self, **fields: Unpack[Fields]) -> Request:
        """The same request with some fields set, checked as a whole."""
        return self._with(KEYWORDS, dict(fields))
'''


def schema_of(library: str) -> dict[str, Any]:
    """The schema that a compiled module knows."""
    loader = importlib.machinery.ExtensionFileLoader("_native", library)
    spec = importlib.util.spec_from_file_location("_native", library, loader=loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    schema: dict[str, Any] = json.loads(module.schema())
    return schema


def name_of(reference: str) -> str:
    return reference.rsplit("/", 1)[1]


def is_section(node: dict[str, Any]) -> bool:
    return node.get("type") == "object" and "properties" in node


def type_of(node: dict[str, Any]) -> str:
    """The annotation of a value."""
    if "$ref" in node:
        return name_of(node["$ref"])
    if "anyOf" in node:
        return " | ".join(type_of(choice) for choice in node["anyOf"])
    kinds = node["type"] if isinstance(node["type"], list) else [node["type"]]
    return " | ".join(plain_type(kind, node) for kind in kinds)


def plain_type(kind: str, node: dict[str, Any]) -> str:
    if kind == "array":
        item = type_of(node["items"])
        count = node.get("maxItems")
        if count is not None and count == node.get("minItems"):
            return f"tuple[{', '.join([item] * count)}]"
        return f"Sequence[{item}]"
    if kind == "object":
        return f"Mapping[str, {type_of(node['additionalProperties'])}]"
    return {"string": "str", "integer": "int", "number": "float", "boolean": "bool", "null": "None"}[kind]


def text(words: str, indent: str) -> list[str]:
    """A docstring."""
    lines = textwrap.wrap(" ".join(words.split()), 100 - len(indent)) or [""]
    if len(lines) == 1:
        return [f'{indent}"""{lines[0]}"""']
    return [f'{indent}"""{lines[0]}', *(indent + line for line in lines[1:]), f'{indent}"""']


def choice(name: str, node: dict[str, Any]) -> list[str]:
    """A word out of several, or an object with one member."""
    words = [part["const"] for part in node["oneOf"] if "const" in part]
    lines: list[str] = []
    members = [f"Literal[{', '.join(json.dumps(word) for word in words)}]"] if words else []
    for part in node["oneOf"]:
        if "const" in part:
            continue
        ((member, value),) = part["properties"].items()
        kind = name + member.capitalize()
        members.append(kind)
        lines += ["", "", f"class {kind}(TypedDict):", *text(part["description"], "    "), "", f"    {member}: {type_of(value)}"]
    alias = members[0] if len(members) == 1 else f"Union[{', '.join(members)}]"
    meanings = [f"{part['const']}: {part['description']}" for part in node["oneOf"] if "const" in part]
    return [*lines, "", "", f"{name} = {alias}", *text(" ".join([node["description"], *meanings]), "")]


def default_of(node: dict[str, Any], required: bool, defs: dict[str, Any]) -> str:
    if required:
        return ""
    if "$ref" in node and is_section(defs[name_of(node["$ref"])]):
        return f" = field(default_factory={name_of(node['$ref'])})"
    value = node.get("default")
    if isinstance(value, list) and type_of(node).startswith("tuple["):
        return f" = {tuple(value)!r}"
    if isinstance(value, (list, dict)):
        return f" = field(default_factory=lambda: {pprint.pformat(value, width=200)})"
    return f" = {value!r}"


def section(name: str, node: dict[str, Any], defs: dict[str, Any]) -> list[str]:
    """A class of fields."""
    base = "BaseRequest" if name == "Request" else "Section"
    lines = ["", "", "@dataclass(kw_only=True, slots=True)", f"class {name}({base}):", *text(node["description"], "    "), ""]
    parts = {}
    tuples = []
    for member, value in node["properties"].items():
        required = member in node.get("required", [])
        kind = type_of(value)
        # Plain Python: a class attribute called `float` or `str` would hide the type from the annotations after it.
        lines.append(f"    {member}: {kind}{default_of(value, required, defs)}")
        lines += text(value.get("description", ""), "    ")
        for part in kind.split(" | "):
            if part in defs and is_section(defs[part]):
                parts[member] = part
        if kind.startswith("tuple["):
            tuples.append(member)
    shown = ", ".join(f'"{member}": {part}' for member, part in parts.items())
    lines += ["", f"    _parts: ClassVar[Mapping[str, type[Section]]] = {{{shown}}}"]
    lines += [f"    _tuples: ClassVar[frozenset[str]] = frozenset({sorted(tuples)!r})"]
    return lines + (OF.rstrip().split("\n") if name == "Request" else [])


def fields(schema: dict[str, Any], defs: dict[str, Any]) -> list[str]:
    """What `render` and `Request.of` take by name."""
    lines = ["", "", "class Fields(TypedDict, total=False):"]
    lines += text("Fields of a request by name: short names of those that are used most, and whole sections.", "    ")
    for keyword, path in KEYWORDS.items():
        part, member = path.split(".")
        value = defs[name_of(schema["properties"][part]["$ref"])]["properties"][member]
        lines += ["", f"    {keyword}: {type_of(value)}", *text(f"`{path}`: {value['description']}", "    ")]
    for member, value in schema["properties"].items():
        if member in ("version", "scene"):
            continue
        kind = type_of(value)
        if kind.split(" | ")[0] in defs:
            kind += " | Mapping[str, Any]"
        if member == "output":
            kind += " | str | os.PathLike[str]"
        lines += ["", f"    {member}: {kind}", *text(value["description"], "    ")]
    return lines


def in_order(defs: dict[str, Any]) -> list[str]:
    """The names of all sections, each after those that it contains."""
    names: list[str] = []

    def add(name: str) -> None:
        if name in names or not is_section(defs[name]):
            return
        for value in defs[name]["properties"].values():
            for part in type_of(value).split(" | "):
                if part in defs:
                    add(part)
        names.append(name)

    for name in defs:
        add(name)
    return names


def module(schema: dict[str, Any]) -> str:
    """The text of the module."""
    defs = schema["$defs"]
    lines = HEAD.rstrip().split("\n")
    for name, node in defs.items():
        if "oneOf" in node:
            lines += choice(name, node)
        elif not is_section(node):
            lines += ["", "", f"{name} = {type_of(node)}", *text(node["description"], "")]
    lines += fields(schema, defs)
    lines += ["", "", f"KEYWORDS: Mapping[str, str] = {pprint.pformat(KEYWORDS, width=100, sort_dicts=False)}"]
    lines += text("Short names of fields.", "")
    for name in in_order(defs):
        lines += section(name, defs[name], defs)
    lines += section("Request", schema, defs)
    return "\n".join(lines) + "\n"


def main() -> int:
    library, *options = sys.argv[1:]
    made = module(schema_of(library))
    if "--check" in options:
        if TARGET.read_text(encoding="utf-8") == made:
            return 0
        print(f"{TARGET} is not what the schema of requests says: run `cargo xtask python-stubs`", file=sys.stderr)
        return 1
    TARGET.write_text(made, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
