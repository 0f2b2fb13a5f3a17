"""One stream's time: no hole in it, whatever does not come.

A player that has nothing for a moment stops there, some for good. So where a picture is missing, the one
before it is shown again, by a picture that says just that (`media/bridge.py`): a decoder sees an ordinary
stream.
"""

from __future__ import annotations

from server.media.gap_filler import Bridge
from server.media.picture import Picture
from server.media.stream_format import Agreement

_LONG_S = 2
"""Holes up to so long get a picture for every pulse, longer ones a single picture that lasts."""
LONGEST_GAP_S = 3600
"""Nobody waits that long: a longer hole stays one, and a duration fits into MP4's 32 bits."""
_ANEW_S = 10
"""A key picture so far back is of pulses that began anew, not a late one."""


class GaplessTimeline:
    """What a stream has shown so far, and what it must show so that the next picture follows.

    ``gop`` is the number of pulses from key picture to key picture.
    """

    def __init__(self, agreement: Agreement, fps: float, gop: int) -> None:
        self.agreement, self._fps, self._gop = agreement, fps, gop
        self._newest: Picture | None = None
        """The picture that the next one is decoded by."""
        self._until = 0
        self._broken = False
        """A picture is missing that the next ones are decoded by, up to a key picture."""

    @property
    def newest(self) -> Picture | None:
        """The picture that was shown last; None before the first."""
        return self._newest

    @property
    def until(self) -> int | None:
        """The first pulse that is not filled yet; None before the first picture."""
        return None if self._newest is None else self._until

    def take(self, picture: Picture) -> list[Picture]:
        """Give what to show now that this picture has come: it, if it can be, after what bridges a hole.

        Late ones give nothing, and neither does what comes before the first key picture.
        """
        if self._newest is None or self._begins_anew(picture):
            return self._show(picture) if picture.key else []
        if picture.pulse < self._until:
            return []
        if not picture.key and self._lost_before(picture):
            return self.fill(picture.until)
        return self._slip_in(picture) + self._show(picture)

    def pass_by(self, last: Picture) -> None:
        """Note that a whole GOP is shown, of which this is the last picture: nothing has to be bridged."""
        self._show(last)

    def fill(self, until: int) -> list[Picture]:
        """Give what repeats the last picture up to a pulse; nothing before the first picture."""
        bridge, missing = self._bridge(), until - self._until
        if bridge is None or self._newest is None or not 0 < missing <= LONGEST_GAP_S * self._fps:
            return []
        each = 1 if missing <= _LONG_S * self._fps else missing
        filled = bridge.after(self._newest, [(pulse, each) for pulse in range(self._until, until, each)])
        self._newest, self._until, self._broken = filled[-1], until, True
        return filled

    def _show(self, picture: Picture) -> list[Picture]:
        self._newest, self._until, self._broken = picture, picture.until, False
        return [picture]

    def _slip_in(self, picture: Picture) -> list[Picture]:
        """Give what bridges the hole before a picture that can be decoded after the last one."""
        if picture.pulse == self._until:
            return []
        if picture.key:
            return self.fill(picture.pulse)
        bridge = self._bridge()
        return [] if bridge is None else bridge.before(picture, (self._until, picture.pulse - self._until))

    def _lost_before(self, picture: Picture) -> bool:
        """Tell whether something is missing that a picture is decoded by."""
        bridge, newest = self._bridge(), self._newest
        if bridge is None or newest is None:
            return False
        if (
            self._broken
            or picture.boot != newest.boot
            or picture.pulse // self._gop != newest.pulse // self._gop
        ):
            return True
        return bridge.is_lost_between(newest, picture, picture.pulse - self._until)

    def _begins_anew(self, picture: Picture) -> bool:
        return picture.key and picture.pulse < self._until - _ANEW_S * self._fps

    def _bridge(self) -> Bridge | None:
        return None if self._newest is None else self.agreement.bridge(self._newest, self._fps)
