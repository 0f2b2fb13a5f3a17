"""From the tracker's windows to the messages that a camera sends."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

import tracking
from server.messaging.epochs import closing_epoch, epoch_of_window
from server.messaging.messages import AppearanceHistogram, Box, CameraTracks, SolverReport, TrackMessage
from server.messaging.number_types import COORDINATE_MAX
from server.messaging.operator_messages import RISK_EVENTS_MAX, RiskEvent
from tracking import SolveReport, WindowResult, WindowTrack, types

_LOOK_DIGITS = 5
"""Of a share of the pixels: more would only make messages longer."""


class TrackMessageBuilder:
    """Builds a camera's track messages, and counts the frames without detection."""

    def __init__(self, camera: str, boot: int, size: tuple[int, int], stride: int) -> None:
        self._camera, self._boot, self._size, self._stride = camera, boot, size, stride
        self._shed: list[int] = []
        self._unsearched: list[int] = []
        self._alone: list[int] = []

    def shed(self, pulses: Iterable[int]) -> None:
        """Note frames that nobody was looked for in; the next message says so."""
        self._shed.extend(pulses)

    def unsearched(self, pulses: Iterable[int]) -> None:
        """Note frames in which nobody could have been found; the next message says so."""
        self._unsearched.extend(pulses)

    def alone(self, pulse: int) -> None:
        """Note a frame for which some other camera's word was not there; the next message says so."""
        self._alone.append(pulse)

    def regular(self, result: WindowResult) -> CameraTracks:
        """Report a window."""
        return self._message(result, epoch_of_window(result.last, self._stride), ended=False)

    def closing(self, result: WindowResult | None, last: int) -> CameraTracks:
        """Report the end of the recording."""
        epoch = closing_epoch(last, self._stride)
        if result is not None:
            return self._message(result, epoch, ended=True)
        return CameraTracks(
            camera=self._camera,
            boot=self._boot,
            size=self._size,
            epoch=epoch,
            first=last + 1,
            last=last,
            final_to=last,
            ended=True,
            shed=_taken(self._shed),
            without_detection=_taken(self._unsearched),
            without_peers=_taken(self._alone),
            tracks=[],
            solve=None,
        )

    def _message(self, result: WindowResult, epoch: int, *, ended: bool) -> CameraTracks:
        return CameraTracks(
            camera=self._camera,
            boot=self._boot,
            size=self._size,
            epoch=epoch,
            first=result.first,
            last=result.last,
            final_to=result.final_to,
            ended=ended,
            shed=_taken(self._shed),
            without_detection=_taken(self._unsearched),
            without_peers=_taken(self._alone),
            tracks=[_track(track) for track in result.tracks],
            solve=_solve(result.report),
            risk_events=[_trouble(it) for it in result.risk_events[:RISK_EVENTS_MAX]],
            revised_from=result.revised_from,
        )


def _taken(noted: list[int]) -> list[int]:
    """Take out what was noted since the last message."""
    taken = noted.copy()
    noted.clear()
    return taken


def _track(track: WindowTrack) -> TrackMessage:
    # With short moments of hiding filled in: they are no reason to show somebody from elsewhere.
    return TrackMessage(
        id=track.id,
        boxes=[_box(row) for row in track.interpolated],
        confidence=float(track.confidence),
        appearance=[_glimpse(look) for look in track.appearance_samples],
    )


def _trouble(trouble: types.RiskEvent) -> RiskEvent:
    return RiskEvent(
        reason=trouble.reason,
        tracks=list(trouble.objects),
        pulse=max(trouble.frame, 0),
        margin=float(trouble.margin),
        risk=float(trouble.risk),
    )


def _glimpse(look: tracking.AppearanceSample) -> AppearanceHistogram:
    shares = [round(float(share), _LOOK_DIGITS) for share in look.histogram]
    return AppearanceHistogram(first=look.first, last=look.last, histogram=shares)


def _box(row: NDArray[np.float64]) -> Box | None:
    left, top, right, bottom = (float(side) for side in np.clip(row, -COORDINATE_MAX, COORDINATE_MAX))
    return None if np.isnan(left) else (left, top, right, bottom)


def _solve(report: SolveReport | None) -> SolverReport | None:
    if report is None:
        return None
    return SolverReport(
        objective=report.objective,
        bound=report.bound,
        gap=report.gap,
        integral=report.integral,
        rounds=report.rounds,
    )
