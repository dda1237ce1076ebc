# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of baked pictures: they change with the nodes that were baked."""

from __future__ import annotations

import hashlib
from typing import Any

# The custom property of a material or a world that has the baked pictures by name of the input.
PROPERTY = "bottega_baked"
# What does not change the values of a node.
_LOOKS = {"rna_type", "location", "location_absolute", "width", "height", "select", "color", "use_custom_color", "label", "parent", "show_options", "show_preview"}


def name_of(socket: Any) -> str:
    """Returns a name for what feeds an input: nodes with other values have another name."""
    parts: list[str] = []
    _describe(socket, parts, set(), 0)
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32]


def _describe(socket: Any, parts: list[str], seen: set[Any], depth: int) -> None:
    for link in socket.links:
        node = link.from_node
        parts.append(f"{depth} {node.bl_idname} {link.from_socket.identifier}")
        if node in seen or depth > 200:
            continue
        seen.add(node)
        parts.extend(_properties(node))
        for one in node.inputs:
            value = getattr(one, "default_value", None)
            parts.append(f"{one.identifier} {_text(value)}")
            _describe(one, parts, seen, depth + 1)


def _properties(node: Any) -> list[str]:
    texts = []
    for prop in node.bl_rna.properties:
        if prop.identifier not in _LOOKS and not prop.identifier.startswith("bl_") and prop.type in ("BOOLEAN", "INT", "FLOAT", "ENUM", "STRING"):
            texts.append(f"{prop.identifier} {_text(getattr(node, prop.identifier))}")
    for name in ("image", "node_tree"):
        block = getattr(node, name, None)
        if block is not None:
            texts.append(f"{name} {block.name_full}")
    ramp = getattr(node, "color_ramp", None)
    if ramp is not None:
        texts += [f"{element.position} {_text(element.color)}" for element in ramp.elements]
    return texts


def _text(value: Any) -> str:
    if isinstance(value, (bool, int, str)) or value is None:
        return str(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    try:
        return " ".join(_text(member) for member in value)
    except TypeError:
        return str(value)
