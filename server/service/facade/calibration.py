"""Calibration by a walk that the operator starts, watches and finishes. It changes no configuration."""

from __future__ import annotations

import msgspec

from server.service.calibration.calibration_report import coverage_gaps
from server.service.calibration.walk_session import MAX_WALK_S, WalkState
from server.service.calibration.worker import CalibrationResult
from server.service.facade.errors import ConflictError
from server.service.pipeline import BestViewPipeline

_GROUND_LINE = "ground: ground.json\n"


class WalkCamera(msgspec.Struct, frozen=True):
    """One camera's coverage of a walk."""

    camera: str
    foot_points: int
    """Foot points seen while another camera saw a person, too; some five a second."""
    thirds: list[float]
    """Shares of them in the left, middle and right third of the image."""
    depth_ratio: float | None
    """Apparent height of the nearest over that of the farthest; null: too few foot points."""


class WalkPair(msgspec.Struct, frozen=True):
    """For how many seconds two cameras saw a person at the same time."""

    one: str
    other: str
    seconds: float


class WalkStatus(msgspec.Struct, frozen=True):
    """The calibration walk: its coverage so far, and its result."""

    state: str
    """none, walking, working (calibration runs) or done."""
    seconds: float
    """The duration of the walk."""
    max_seconds: float
    """The longest walk; later boxes are ignored."""
    cameras: list[WalkCamera]
    pairs: list[WalkPair]
    uncovered: list[str]
    """Where else to walk, as far as is known before the calibration."""
    error: str
    """Why the calibration failed; empty: it succeeded, or has not finished."""
    lines: list[str]
    """The report of the calibration."""
    insufficient: str
    """What the walk did not cover, if the result is only a guess because of that; else empty."""
    configuration: str
    """Lines for the configuration; empty: there is no ground file."""


class CalibrationService:
    """Queries and commands about the calibration walk."""

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._walk = pipeline.walk_session

    def status(self) -> WalkStatus:
        """Return the coverage of the walk so far, and the result of the calibration."""
        walk = self._walk
        result = walk.result or CalibrationResult()
        covered = walk.coverage()
        uncovered = [
            gap.text
            for camera in covered.cameras
            for gap in coverage_gaps(camera.camera, camera.thirds, camera.depth_ratio or float("inf"))
        ]
        return WalkStatus(
            state=walk.state.value,
            seconds=walk.seconds,
            max_seconds=MAX_WALK_S,
            cameras=[
                WalkCamera(camera.camera, camera.shared_foot_points, list(camera.thirds), camera.depth_ratio)
                for camera in covered.cameras
            ],
            pairs=[WalkPair(pair.one, pair.other, pair.seconds) for pair in covered.pairs],
            uncovered=uncovered,
            error=result.error,
            lines=result.lines,
            insufficient=result.insufficient,
            configuration=_GROUND_LINE + result.offsets if result.ground else "",
        )

    def start(self) -> None:
        """Start a walk; an earlier one is discarded."""
        self._walk.start()

    def resume(self) -> None:
        """Continue the walk after a calibration.

        Raises:
            ConflictError: there is no walk.
        """
        self._check_started()
        if self._walk.state is not WalkState.WALKING:
            self._walk.resume()

    def finish(self, person_height: float) -> None:
        """Calibrate from the walk, in a separate process; ``person_height`` is in meters.

        Raises:
            ConflictError: there is no walk.
        """
        self._check_started()
        if self._walk.state is not WalkState.WORKING:
            self._walk.finish(person_height)

    def discard(self) -> None:
        """Discard the walk and its result."""
        self._walk.discard()

    async def close(self) -> None:
        """Discard the walk, and wait until no calibration process is left."""
        await self._walk.close()

    def ground_file(self) -> bytes | None:
        """Return the ground file that the walk has resulted in, JSON; None: there is none."""
        result = self._walk.result
        return result.ground.encode() if result is not None and result.ground else None

    def floor_plan(self) -> bytes | None:
        """Return the drawn floor plan that the walk has resulted in, PNG; None: there is none."""
        result = self._walk.result
        return result.plan if result is not None and result.plan else None

    def _check_started(self) -> None:
        if self._walk.state is WalkState.NONE:
            raise ConflictError("there is no walk: start one first")
