# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of what was exported exactly, what was approximated and how, and what was left out."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum


class Fidelity(Enum):
    """How well a thing of Blender is rendered."""

    APPROXIMATED = "approximated"
    BAKED = "baked"
    LEFT_OUT = "left out"


@dataclass(frozen=True)
class Note:
    """A thing that is not rendered exactly as Cycles renders it."""

    owner: str
    """The material, light, world or object."""
    node: str
    """The node, or the property."""
    fidelity: Fidelity
    text: str
    """What is rendered instead, or why it is not rendered."""


@dataclass
class Report:
    """Notes by the key of what they are about; a thing without notes is rendered exactly."""

    notes: dict[str, list[Note]] = field(default_factory=dict)

    def begin(self, key: str) -> None:
        """Forgets the notes of a thing, before it is exported again."""
        self.notes[key] = []

    def forget(self, key: str) -> None:
        """Forgets a thing."""
        self.notes.pop(key, None)

    def add(self, key: str, owner: str, node: str, fidelity: Fidelity, text: str) -> None:
        """Adds a note, once."""
        note = Note(owner, node, fidelity, text)
        notes = self.notes.setdefault(key, [])
        if note not in notes:
            notes.append(note)

    def all(self) -> list[Note]:
        """Returns all notes once, the worst first."""
        order = [Fidelity.LEFT_OUT, Fidelity.APPROXIMATED, Fidelity.BAKED]
        every = list(dict.fromkeys(note for notes in self.notes.values() for note in notes))
        return sorted(every, key=lambda note: (order.index(note.fidelity), note.owner, note.node))
