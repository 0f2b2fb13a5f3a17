"""Builds a camera's track messages from the tracker's window results."""

from __future__ import annotations

from collections.abc import Iterable

from server.messaging.epochs import epoch_of_recording_end, epoch_of_window
from server.messaging.messages import CameraTracks
from server.messaging.operator_messages import RISK_EVENTS_MAX, RiskEvent
from server.messaging.track_conversion import solver_report, track_message
from tracking import WindowResult, types


class TrackMessageBuilder:
    """Builds a camera's track messages, and collects the frames without detection for them."""

    def __init__(self, camera: str, boot: int, size: tuple[int, int], stride: int) -> None:
        self._camera, self._boot, self._size, self._stride = camera, boot, size, stride
        self._shed: list[int] = []
        self._without_detection: list[int] = []
        self._without_peers: list[int] = []

    def add_without_image(self, pulses: Iterable[int]) -> None:
        """Add frames that were missed, shed or had no image to the next message, as shed."""
        self._shed.extend(pulses)

    def add_without_detection(self, pulses: Iterable[int]) -> None:
        """Add frames without detection to the next message."""
        self._without_detection.extend(pulses)

    def add_without_peers(self, pulse: int) -> None:
        """Add a frame without the detections of some peer to the next message."""
        self._without_peers.append(pulse)

    def regular(self, result: WindowResult) -> CameraTracks:
        """Build the message of a window."""
        return self._message(result, epoch_of_window(result.last, self._stride), ended=False)

    def closing(self, result: WindowResult | None, last: int) -> CameraTracks:
        """Build the last message of a recording."""
        epoch = epoch_of_recording_end(last, self._stride)
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
            shed=_pop_until(self._shed, last),
            without_detection=_pop_until(self._without_detection, last),
            without_peers=_pop_until(self._without_peers, last),
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
            shed=_pop_until(self._shed, result.last),
            without_detection=_pop_until(self._without_detection, result.last),
            without_peers=_pop_until(self._without_peers, result.last),
            tracks=[track_message(track) for track in result.tracks],
            solve=solver_report(result.report),
            risk_events=[_risk_event(event) for event in result.risk_events[:RISK_EVENTS_MAX]],
            revised_from=result.revised_from,
        )


def _pop_until(frames: list[int], last: int) -> list[int]:
    """Remove and return the frames up to a message's last; after missed pulses there are later ones."""
    popped = [frame for frame in frames if frame <= last]
    frames[:] = [frame for frame in frames if frame > last]
    return popped


def _risk_event(event: types.RiskEvent) -> RiskEvent:
    return RiskEvent(
        reason=event.reason,
        tracks=list(event.objects),
        pulse=max(event.frame, 0),
        margin=float(event.margin),
        risk=float(event.risk),
    )
