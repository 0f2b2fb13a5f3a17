"""Messages to and from the search process, MessagePack, and the function that runs it."""

from __future__ import annotations

import msgspec

from server.system.errors import reason_of
from server.system.worker.process import WorkerDiedError
from server.system.worker.single_request import ask_new_worker

SEARCH_TIMEOUT_S = 30.0
"""How long a search may take; a disk that hangs must not keep processes for ever."""


class CameraMessage(msgspec.Struct, frozen=True, array_like=True):
    """One camera of today."""

    camera: str
    size: tuple[int, int] | None
    """Width and height of its own picture, pixels; None: it has not sent any yet."""
    ground: list[list[float]] | None
    """(3, 3), from the site's picture to the floor."""
    is_overhead: bool


class ZoneMessage(msgspec.Struct, frozen=True, array_like=True):
    """One area of today, in pixels of its camera's own picture, or in the unit of the floor."""

    zone: str
    camera: str | None
    corners: list[tuple[float, float]]


class RunFiles(msgspec.Struct, frozen=True, array_like=True):
    """Files of decisions of one run, in order; ``run`` is empty where numbers mean the same as now."""

    run: str
    files: list[str]


class SearchTask(msgspec.Struct, frozen=True):
    """A search of the pulses ``start … end - 1``."""

    start: int
    end: int
    step: int
    """Frames between samples."""
    gap: int
    """Frames of absence within one stay, at most."""
    shortest: int
    """Frames of a stay, at least."""
    runs: list[RunFiles]
    recent: bytes
    """Lines of the newest decisions, which may not be on the disk yet."""
    site_size: tuple[int, int]
    cameras: list[CameraMessage]
    """Those whose boxes count."""
    zones: list[ZoneMessage]
    """Areas whose stays are searched."""
    by_camera: list[str]
    """Cameras whose stays are searched."""
    anywhere: bool
    """Whether stays anywhere on the site are searched."""
    number: int | None
    """The person, by present number; None: everybody."""
    merged: dict[int, int]
    """Merged numbers of the present run, with those that were kept."""
    order: str
    """`time`, `newest` or `longest`."""
    limit: int
    """Stays, and people, at most."""
    work_s: float
    """Processor time after which no further file is read."""


class FoundStay(msgspec.Struct, frozen=True, array_like=True):
    """A stay in the pulses ``first … end - 1``."""

    run: str
    number: int
    zone: str | None
    camera: str | None
    first: int
    end: int
    cameras: list[str]
    """Those that saw the person there, the most frequent first."""


class FoundPerson(msgspec.Struct, frozen=True, array_like=True):
    """A person with a stay."""

    run: str
    number: int
    first: int
    """The first pulse of their stays."""
    end: int
    """The pulse after the last."""
    frames: int
    """The length of their stays; what overlaps counts once."""
    stays: int


class StaySearchResult(msgspec.Struct, frozen=True):
    """What was found up to a pulse."""

    end: int
    """The pulse after the last one searched."""
    stays: list[FoundStay]
    people: list[FoundPerson]
    """By first pulse."""
    found: int
    """The number of stays, also of those that are not listed."""


class SearchError(Exception):
    """The search process has failed; the text is one line."""


async def run_search(task: SearchTask) -> StaySearchResult:
    """Search in a separate process, which is killed if the caller is cancelled, or it takes too long.

    Raises:
        SearchError: the process cannot be started, failed, or took too long.
    """
    try:
        return await ask_new_worker("server.service.past_search", task, StaySearchResult, SEARCH_TIMEOUT_S)
    except TimeoutError as error:
        raise SearchError(f"the recording was not read within {SEARCH_TIMEOUT_S:g} s") from error
    except OSError as error:
        raise SearchError(f"the search cannot be started: {reason_of(error)}") from error
    except WorkerDiedError as error:
        raise SearchError(f"the search process {error}") from error
