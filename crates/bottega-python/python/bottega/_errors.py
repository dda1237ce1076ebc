"""The exceptions and warnings of the package."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._native import Picture


class Error(Exception):
    """An error of Bottega. `remedy` says what the user can do about it; `None`: nothing specific."""

    def __init__(self, problem: str, remedy: str | None = None) -> None:
        super().__init__(problem)
        self.problem = problem
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.problem}; {self.remedy}" if self.remedy else self.problem


class RequestError(Error, ValueError):
    """A request is invalid, or cannot be fulfilled as it stands.

    `field` is the path of the wrong field, such as `film.size`, `value` its value, and `allowed` the allowed values; each is `None`
    if the error is not about a single field.
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
    """A scene cannot be read or prepared, or an array has a wrong shape, dtype or value."""


class PictureError(Error, OSError):
    """A picture cannot be read, written or denoised."""


class EngineError(Error):
    """An engine or a GPU cannot be used, or failed."""


class RulesError(Error, ValueError):
    """Rules cannot be read or evaluated."""


class FarmError(Error):
    """A farm is not reachable, or cannot do what was requested."""


class ForkError(Error, RuntimeError):
    """The process was forked from one that has used `bottega`, whose threads do not exist here."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during rendering. `picture` is the picture painted so far; `None`: nothing is painted."""

    def __init__(self, picture: Picture | None = None) -> None:
        super().__init__("the painting was interrupted")
        self.picture = picture


class RenderWarning(UserWarning):
    """A warning about a picture; rendering continues."""
