"""The sound of a network camera, as it comes beside the camera's pictures."""

from __future__ import annotations

import logging
import threading
from collections import deque
from fractions import Fraction

from av.audio.stream import AudioStream

from logthrottle import LogThrottle
from server.camera.audio.frames import AudioFramer, EncodedAudioFrame, Packet
from server.camera.audio.selection import select_framer
from server.config.sections import SoundSettings

log = logging.getLogger(__name__)

_MEAN_S = 4.0
"""How late pictures are shown is averaged over so long: each waits for its pulse, more or less."""
_ANEW_S = 0.5
"""A picture that comes this much sooner or later than those before tells of another time."""
_WAITING_S = 2.0
"""Sound that may wait to be fetched."""
_FAR_S = 2.0
"""Sound that is further away from what is shown is of another time: one of the two clocks has stepped."""


class LiveAudioSource:
    """Audio of a network camera, aligned with its pictures by the camera's own clock.

    A source tells it what comes, in a thread of its own; ``at`` is called in another. Pictures wait for up to
    ``waiting_s`` until they are shown, and sound with them.
    """

    def __init__(self, settings: SoundSettings, fps: float, waiting_s: float = 0.0) -> None:
        form = settings.format
        if form is None:
            raise ValueError("a site without sound")
        self._form, self._kbps, self._fps = form, settings.kbps, fps
        self._far_s = _FAR_S + waiting_s
        self._lock = threading.Lock()
        self._asked = 0.0
        """When what is shown now is shown, seconds after pulse 0."""
        self._newest: Fraction | None = None
        """When the newest picture was taken, by the camera's clock."""
        self._shifts: deque[float] = deque(maxlen=max(1, round(_MEAN_S * fps)))
        """Of the last pictures: how much later they are shown, counted from pulse 0."""
        self._shift: Fraction | None = None
        self._frames: deque[EncodedAudioFrame] = deque(maxlen=round(_WAITING_S * form.rate / form.samples))
        self._way: AudioFramer | None = None
        self._last = -1
        self._silent = LogThrottle(quiet_s=0.0)

    def opened(self, stream: AudioStream | None) -> None:
        """Begin with a connection."""
        self._way = None
        if stream is None:
            if (more := self._silent.record()) is not None:
                log.warning("there is no sound in what the camera sends%s; the site is silent", more)
        else:
            if self._silent.end():
                log.info("there is sound again in what the camera sends")
            self._way = select_framer(stream, self._form, self._kbps)

    def picture(self, time: Fraction) -> None:
        """Note when the newest picture was taken, by the camera's clock."""
        with self._lock:
            self._newest = time

    def packet(self, packet: Packet) -> None:
        """Take some sound."""
        with self._lock:
            shift, asked = self._shift, self._asked
        if shift is None or self._way is None or packet.pts is None or packet.time_base is None:
            return
        at = packet.pts * packet.time_base + shift
        if abs(at - asked) > self._far_s:
            return  # once taken, it would keep out all that comes before it
        for frame in self._way.take(packet, at):
            if frame.number <= self._last:
                continue  # of a time that is past: a connection was opened anew, or the mean has moved
            self._last = frame.number
            with self._lock:
                self._frames.append(frame)

    def at(self, pulse: int) -> list[EncodedAudioFrame]:
        """Return what has come since the pulse before, now that the newest picture is shown at this one."""
        with self._lock:
            self._asked = pulse / self._fps
            if self._newest is not None:
                self._note(pulse / self._fps - float(self._newest))
                self._newest = None
            frames = list(self._frames)
            self._frames.clear()
        return frames

    def _note(self, shift: float) -> None:
        if self._shift is not None and abs(shift - self._shift) > _ANEW_S:
            self._shifts.clear()
        self._shifts.append(shift)
        self._shift = Fraction(sum(self._shifts) / len(self._shifts))
