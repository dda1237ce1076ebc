# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes of Blender: links through groups, reroutes and muted nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

MOST_STEPS = 500


class CyclicNodes(Exception):
    """Nodes or groups that feed themselves."""


def uid_of(block: Any) -> Any:
    """Returns the number that a data block has for the session; its name before Blender 4.2."""
    uid = getattr(block, "session_uid", None)
    return block.name_full if uid is None else uid


@dataclass(frozen=True)
class Source:
    """The output of a node, and the group nodes around it, the innermost last."""

    node: Any
    output: Any
    groups: tuple[Any, ...]


@dataclass(frozen=True)
class Input:
    """An input of a node within groups."""

    socket: Any
    groups: tuple[Any, ...] = ()

    def source(self) -> Source | None:
        """Returns what feeds the input; `None`: nothing, so its own value counts. Raises `CyclicNodes`."""
        return self._followed()[0]

    def value(self) -> Any:
        """Returns the value of the input, or of the group's input it leads to, where nothing feeds it."""
        return getattr(self._followed()[1], "default_value", None)

    def _followed(self) -> tuple[Source | None, Any]:
        socket, groups = self.socket, self.groups
        for _ in range(MOST_STEPS):
            link = next((link for link in socket.links if link.is_valid and not getattr(link, "is_muted", False)), None)
            if link is None:
                return None, socket
            node, output = link.from_node, link.from_socket
            step = _through(node, output, groups)
            if step is None:
                return Source(node, output, groups), socket
            socket, groups = step
            if socket is None:
                return None, None
        raise CyclicNodes("the nodes feed themselves")


def _through(node: Any, output: Any, groups: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]] | None:
    """Returns the input behind an output that only passes values on, with the groups around it; `None`: the node makes the value."""
    if node.mute:
        passed = next((link.from_socket for link in node.internal_links if link.to_socket == output), None)
        return passed, groups
    if node.bl_idname == "NodeReroute":
        return node.inputs[0], groups
    if node.bl_idname == "NodeGroupInput" and groups:
        outer = groups[-1]
        return _by_identifier(outer.inputs, output.identifier), groups[:-1]
    if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
        if len(groups) > 50 or any(group.node_tree == node.node_tree for group in groups):
            raise CyclicNodes(f"the group {node.node_tree.name} contains itself")
        ends = [inner for inner in node.node_tree.nodes if inner.bl_idname == "NodeGroupOutput"]
        end = next((inner for inner in ends if inner.is_active_output), ends[0] if ends else None)
        return (_by_identifier(end.inputs, output.identifier) if end else None), (*groups, node)
    return None


def _by_identifier(sockets: Any, identifier: str) -> Any:
    return next((socket for socket in sockets if socket.identifier == identifier), None)


def named(node: Any, groups: tuple[Any, ...], *names: str) -> Input | None:
    """Returns the first input of a node that has one of the names and is not switched off."""
    for name in names:
        for socket in node.inputs:
            if socket.name == name and getattr(socket, "enabled", True):
                return Input(socket, groups)
    return None


def groups_of(tree: Any) -> set[Any]:
    """Returns the session numbers of the groups in a tree, and in its groups."""
    found: set[Any] = set()
    trees = [tree]
    while trees:
        for node in trees.pop().nodes:
            group = node.node_tree if node.bl_idname == "ShaderNodeGroup" else None
            if group is not None and uid_of(group.original) not in found:
                found.add(uid_of(group.original))
                trees.append(group)
    return found
