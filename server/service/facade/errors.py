"""Errors of queries and commands; HTTP maps each to a status code."""

from __future__ import annotations

from collections.abc import Iterable


class RefusedError(Exception):
    """A query or command is refused; the text is one line for the sender."""


class UnknownObjectError(RefusedError):
    """No person has this number."""

    def __init__(self, number: int, *, is_recovering: bool = False) -> None:
        super().__init__(
            f"object {number} cannot be shown yet" if is_recovering else f"there is no object {number}"
        )
        self.is_recovering = is_recovering
        """Whether the number may be recovered from an earlier run."""


class UnknownCameraError(RefusedError):
    """The site has no camera of this name."""

    def __init__(self, camera: str, cameras: Iterable[str]) -> None:
        super().__init__(f"there is no camera {camera!r}; there are {', '.join(cameras)}")


class InvalidCommandError(RefusedError):
    """A command's content is invalid."""


class ConflictError(RefusedError):
    """A command is valid, but not in the service's present state."""


class BusyError(RefusedError):
    """A query is valid, but cannot be answered at the moment."""
