"""An operator's corrections in a camera: received from the bus, and the frames to publish after them."""

from __future__ import annotations

import logging
from collections import deque
from dataclasses import replace

import msgspec
import numpy as np

from logthrottle import LogThrottle
from server.messaging.inbox import Message
from server.messaging.messages import DECODE_ERRORS
from server.messaging.operator_messages import CORRECTIONS_MAX, PositionCorrections
from tracking import WindowResult, WindowTrack, merge_results
from tracking.interactive import PositionCorrection

log = logging.getLogger(__name__)

_DECODER = msgspec.msgpack.Decoder(PositionCorrections)


class CorrectionInbox:
    """Holds the newest corrections for one run of a camera, and counts messages that cannot be parsed."""

    def __init__(self, camera: str, boot: int) -> None:
        self._camera, self._boot = camera, boot
        self._waiting: deque[PositionCorrection] = deque(maxlen=CORRECTIONS_MAX)
        self.count = 0
        """Corrections passed to the tracker so far."""
        self.bad_messages = 0
        self._bad_log = LogThrottle()

    def put(self, message: Message) -> None:
        """Add a message's corrections; those for another run's tracks are ignored."""
        try:
            decoded = _DECODER.decode(message.payload)
        except DECODE_ERRORS as error:
            self.bad_messages += 1
            if (more := self._bad_log.record(str(error))) is not None:
                text = "camera %s: cannot parse a message on %s: %s%s"
                log.warning(text, self._camera, message.key, error, more)
            return
        if ended := self._bad_log.end():
            text = "camera %s: position corrections can be parsed again; %d messages could not"
            log.info(text, self._camera, ended.count)
        if decoded.boot == self._boot:
            self._waiting.extend(
                PositionCorrection(mark.pulse, mark.track, mark.x, mark.y, mark.tolerance)
                for mark in decoded.corrections
            )

    def take(self) -> list[PositionCorrection]:
        """Return and remove the corrections received since the last call, in order."""
        corrections = list(self._waiting)
        self._waiting.clear()
        self.count += len(corrections)
        return corrections


def merge_correction(result: WindowResult, revised: WindowResult) -> WindowResult:
    """Return the result to publish after a window was solved again with an operator's corrections.

    It begins with the first frame that was published as final and has changed, else with the first frame that
    was not final; ``revised_from`` is set in the first case only.

    Args:
        result: the window's result before the correction, not published yet.
        revised: the result after it, which may begin earlier.
    """
    changed = revised.revised_from
    if changed is not None and changed < result.first:
        return _from(revised, changed)
    if revised.first <= result.first:
        return replace(_from(revised, result.first), revised_from=None)
    both = merge_results([result, revised])
    assert both is not None  # noqa: S101 — of two results there is always a merged one
    return replace(both, revised_from=None)


def _from(result: WindowResult, first: int) -> WindowResult:
    """Drop the frames before ``first``, and the tracks without a box in the others."""
    if first <= result.first:
        return result
    tracks = [_cut(track, result.first, first) for track in result.tracks]
    visible = tuple(track for track in tracks if not np.isnan(track.boxes).all())
    return replace(result, first=first, tracks=visible)


def _cut(track: WindowTrack, start: int, first: int) -> WindowTrack:
    histograms = tuple(
        replace(histogram, first=max(histogram.first, first))
        for histogram in track.appearance_histograms
        if histogram.last >= first
    )
    rows = slice(first - start, None)
    return replace(
        track,
        boxes=track.boxes[rows],
        interpolated=track.interpolated[rows],
        appearance_histograms=histograms,
    )
