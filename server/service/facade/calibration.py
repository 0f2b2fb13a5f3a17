"""Calibration by a walk that the operator starts, watches and finishes. It changes no configuration."""

from __future__ import annotations

import msgspec

from server.service.calibration.calibration_report import coverage_gaps
from server.service.calibration.walk_session import MAX_WALK_S, WalkState
from server.service.calibration.worker import CalibrationResult
from server.service.facade.errors import ConflictError
from server.service.pipeline import BestViewPipeline

_LINES = "ground: ground.json\n"


class WalkCamera(msgspec.Struct, frozen=True):
    """What one camera has seen of a walk."""

    camera: str
    foot_points: int
    """Feet that were seen while another camera saw somebody, too, some five a second."""
    thirds: list[float]
    """What shares of them were in the left, the middle and the right third of the picture."""
    depth_ratio: float | None
    """How many times as tall the nearest of them appear as the farthest; null: too few were seen."""


class WalkPair(msgspec.Struct, frozen=True):
    """For how many seconds two cameras saw somebody at once."""

    one: str
    other: str
    seconds: float


class OperatorWalk(msgspec.Struct, frozen=True):
    """The walk that the cameras are calibrated from."""

    state: str
    """none, walking, working (it is calibrated from) or done."""
    seconds: float
    """For how long was walked."""
    max_seconds: float
    """Seconds after which nothing more is taken in."""
    cameras: list[WalkCamera]
    pairs: list[WalkPair]
    uncovered: list[str]
    """Where to walk, too, as far as can be told before it is calibrated from."""
    error: str
    """Why nothing has come of it; empty: something has, or it is not done."""
    lines: list[str]
    """What has come of it, in words."""
    insufficient: str
    """What was not walked, where the result is a guess for want of that; else empty."""
    configuration: str
    """The lines for the configuration; empty: there is no ground file."""


class CalibrationService:
    """Queries and commands about the calibration walk."""

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._walking = pipeline.walking

    def status(self) -> OperatorWalk:
        """Return what was covered of the walk so far, and its result once it is calibrated from."""
        walking = self._walking
        done = walking.done or CalibrationResult()
        covered = walking.coverage()
        uncovered = [
            it.words
            for seen in covered.cameras
            for it in coverage_gaps(seen.camera, seen.thirds, seen.deep or float("inf"))
        ]
        return OperatorWalk(
            state=walking.state.value,
            seconds=walking.seconds,
            max_seconds=MAX_WALK_S,
            cameras=[WalkCamera(it.camera, it.feet, list(it.thirds), it.deep) for it in covered.cameras],
            pairs=[WalkPair(it.one, it.other, it.seconds) for it in covered.pairs],
            uncovered=uncovered,
            error=done.error,
            lines=done.lines,
            insufficient=done.too_little,
            configuration=_LINES + done.offsets if done.ground else "",
        )

    def start(self) -> None:
        """Start a walk; an earlier one is discarded."""
        self._walking.start()

    def resume(self) -> None:
        """Go on with the walk after it was calibrated from.

        Raises:
            ConflictError: there is no walk.
        """
        self._check_started()
        if self._walking.state is not WalkState.WALKING:
            self._walking.go_on()

    def finish(self, person_height: float) -> None:
        """Calibrate from the walk, in a process of its own; ``person_height`` is in meters.

        Raises:
            ConflictError: there is no walk.
        """
        self._check_started()
        if self._walking.state is not WalkState.WORKING:
            self._walking.finish(person_height)

    def discard(self) -> None:
        """Discard the walk and its result."""
        self._walking.stop()

    def ground_file(self) -> bytes | None:
        """Return the ground file that the walk has resulted in, JSON; None: there is none."""
        done = self._walking.done
        return done.ground.encode() if done is not None and done.ground else None

    def floor_plan(self) -> bytes | None:
        """Return the drawn floor plan that the walk has resulted in, PNG; None: there is none."""
        done = self._walking.done
        return done.plan if done is not None and done.plan else None

    def _check_started(self) -> None:
        if self._walking.state is WalkState.NONE:
            raise ConflictError("there is no walk: start one first")
