"""Messages to and from the process that tracks jointly, and its results."""

from __future__ import annotations

from typing import Annotated

import msgspec

from server.messaging.camera_status import PictureMotion
from server.messaging.messages import SolverReport, TrackMessage
from server.messaging.observations import FrameObservations
from server.messaging.packed_arrays import PackedAreas

Row = tuple[float, float, float]


class JointSetup(msgspec.Struct, frozen=True, kw_only=True):
    """What joint tracking needs to know of a site; lengths of time in seconds."""

    homographies: dict[str, tuple[Row, Row, Row]]
    """By camera: from its image, pixels, to the ground."""
    site_size: tuple[int, int]
    fps: float
    stride_s: float
    lag_s: float
    units_per_meter: float | None
    """Of the ground plane; None: unknown."""
    solver: str
    solver_work_s: float | None
    solver_time_s: float | None
    run: int = 0
    """Which tracker of a site it is: its ids count from 1 again."""


class CameraObservations(msgspec.Struct, frozen=True, kw_only=True):
    """A camera's part of an epoch."""

    size: tuple[int, int]
    """Width and height of its image, pixels."""
    frames: list[FrameObservations]
    motion: PictureMotion | None
    covered: PackedAreas
    """The part of the site's picture in which people are hidden."""
    last: int
    """Its last frame in this epoch."""
    ended: bool
    """Whether its recording has ended."""


class JointTask(msgspec.Struct, frozen=True, kw_only=True):
    """The observations of an epoch, which ends with frame `last`, by camera."""

    last: int
    cameras: dict[str, CameraObservations]


class GroundPath(msgspec.Struct, frozen=True, kw_only=True):
    """Where a person went in final frames."""

    id: int
    places: list[tuple[float, float] | None]
    """In ground units, one per frame; None: not there."""
    detected: dict[str, list[bool]]
    """By camera, one per frame: whether it detects them; cameras that never do are left out."""


class JointTracks(msgspec.Struct, frozen=True, kw_only=True):
    """Everybody on the common ground from frame `first`, the first that was not final before, to `last`."""

    run: Annotated[int, msgspec.Meta(ge=0)]
    """Identifies the run of the tracker; its ids count from 1."""
    first: int
    last: int
    final_to: int
    person_height: float
    """In ground units; 0: nobody was seen yet."""
    offsets: dict[str, float]
    """By camera, meters by which it disagrees with the others about where people stand; it is corrected."""
    paths: list[GroundPath]
    cameras: dict[str, list[TrackMessage]]
    """The boxes in each camera that overlaps another, in pixels of the site's image; ids as in `paths`."""
    solve: SolverReport | None
