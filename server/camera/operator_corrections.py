"""Where an operator points in a camera's picture: what comes over the bus, until the tracker takes it."""

from __future__ import annotations

import logging
from collections import deque

import msgspec

from logthrottle import LogThrottle
from server.messaging.inbox import Message
from server.messaging.messages import DECODE_ERRORS
from server.messaging.operator_messages import OPERATOR_POINTS_MAX, OperatorPoints
from tracking.interactive import PositionCorrection

log = logging.getLogger(__name__)

_DECODER = msgspec.json.Decoder(OperatorPoints)


class CorrectionInbox:
    """Keeps the newest corrections of one run of a camera. Messages that cannot be parsed are counted."""

    def __init__(self, camera: str, boot: int) -> None:
        self._camera, self._boot = camera, boot
        self._waiting: deque[PositionCorrection] = deque(maxlen=OPERATOR_POINTS_MAX)
        self.taken = 0
        """Places that the tracker was given."""
        self.bad_messages = 0
        self._bad = LogThrottle()

    def put(self, message: Message) -> None:
        """Take a message in; what is said of another run's tracks is of nobody here."""
        try:
            said = _DECODER.decode(message.payload)
        except DECODE_ERRORS as error:
            self.bad_messages += 1
            if (more := self._bad.record(str(error))) is not None:
                told = "camera %s: a message on %s is none: %s%s"
                log.warning(told, self._camera, message.key, error, more)
            return
        if ended := self._bad.end():
            told = "camera %s: where somebody points is understood again; %d messages were not"
            log.info(told, self._camera, ended.count)
        if said.boot == self._boot:
            self._waiting.extend(
                PositionCorrection(it.pulse, it.track, it.x, it.y, it.tolerance) for it in said.points
            )

    def take(self) -> list[PositionCorrection]:
        """Return what has come since this was last asked, in its order."""
        taken = list(self._waiting)
        self._waiting.clear()
        self.taken += len(taken)
        return taken
