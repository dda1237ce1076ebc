"""What can go wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._native import Picture


class Error(Exception):
    """An error of Bottega. `remedy` says what can be done, where that is known."""

    def __init__(self, problem: str, remedy: str | None = None) -> None:
        super().__init__(problem)
        self.problem = problem
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.problem}; {self.remedy}" if self.remedy else self.problem


class RequestError(Error, ValueError):
    """A request, or what was asked for, cannot be.

    `field` is the path of the field that is wrong, such as `film.size`, `value` what it is, and `allowed` what it may be; each `None`
    where the error is not about one field.
    """

    def __init__(
        self,
        problem: str,
        remedy: str | None = None,
        field: str | None = None,
        value: str | None = None,
        allowed: str | None = None,
    ) -> None:
        super().__init__(problem, remedy)
        self.field = field
        self.value = value
        self.allowed = allowed


class SceneError(Error, ValueError):
    """A scene cannot be read or painted, or an array is of the wrong shape, kind or values."""


class PictureError(Error, OSError):
    """A picture cannot be read, written or denoised."""


class EngineError(Error):
    """An engine or a GPU cannot paint."""


class RulesError(Error, ValueError):
    """Rules cannot be read or evaluated."""


class FarmError(Error):
    """A farm is not there, or cannot do what it is asked for."""


class ForkError(Error, RuntimeError):
    """The process was forked from one that has used bottega."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C while a picture was painted. `picture` is what is painted; `None` where nothing is."""

    def __init__(self, picture: Picture | None = None) -> None:
        super().__init__("the painting was interrupted")
        self.picture = picture


class RenderWarning(UserWarning):
    """Something that you should know of a picture; the work goes on."""
