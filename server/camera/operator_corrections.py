"""Inbox of position corrections: from the bus until the tracker takes them."""

from __future__ import annotations

import logging
from collections import deque

import msgspec

from logthrottle import LogThrottle
from server.messaging.inbox import Message
from server.messaging.messages import DECODE_ERRORS
from server.messaging.operator_messages import CORRECTIONS_MAX, PositionCorrections
from tracking.interactive import PositionCorrection

log = logging.getLogger(__name__)

_DECODER = msgspec.json.Decoder(PositionCorrections)


class CorrectionInbox:
    """Holds the newest corrections for one run of a camera, and counts messages that cannot be parsed."""

    def __init__(self, camera: str, boot: int) -> None:
        self._camera, self._boot = camera, boot
        self._waiting: deque[PositionCorrection] = deque(maxlen=CORRECTIONS_MAX)
        self.taken = 0
        """Corrections passed to the tracker."""
        self.bad_messages = 0
        self._bad = LogThrottle()

    def put(self, message: Message) -> None:
        """Add a message's corrections; those for another run's tracks are ignored."""
        try:
            decoded = _DECODER.decode(message.payload)
        except DECODE_ERRORS as error:
            self.bad_messages += 1
            if (more := self._bad.record(str(error))) is not None:
                text = "camera %s: cannot parse a message on %s: %s%s"
                log.warning(text, self._camera, message.key, error, more)
            return
        if ended := self._bad.end():
            text = "camera %s: position corrections can be parsed again; %d messages could not"
            log.info(text, self._camera, ended.count)
        if decoded.boot == self._boot:
            self._waiting.extend(
                PositionCorrection(it.pulse, it.track, it.x, it.y, it.tolerance) for it in decoded.corrections
            )

    def take(self) -> list[PositionCorrection]:
        """Take out the corrections that came since the last call, in order."""
        taken = list(self._waiting)
        self._waiting.clear()
        self.taken += len(taken)
        return taken
