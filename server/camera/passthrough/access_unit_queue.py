"""Access units of a network camera on their way to the pulses: each goes once, GOPs where the site's do."""

from __future__ import annotations

from collections import deque

from server.camera.passthrough.encoder import PassthroughUnit

_CUSHION = 2
"""Units that wait behind the one that a stream begins with: a network does not bring them evenly."""
_TOO_LATE = 2 * _CUSHION + 1
"""Units that wait behind the beginning of the next GOP before the present one is left out for it."""
_MOST_GOPS = 4


class AccessUnitQueue:
    """A queue that hands out the first access unit of a GOP only at a pulse where a GOP begins.

    A camera begins its GOPs when it likes, so what comes waits for up to a GOP and the cushion; that is how
    much later than others its pictures are. Its clock is not the site's either: now and then a GOP is left
    out, or a pulse finds nothing and the rest of its GOP cannot be used.
    """

    def __init__(self, gop: int) -> None:
        self._gop = gop
        self._units: deque[PassthroughUnit] = deque()
        self._last: int | None = None
        self._whole = False
        """Nothing is missing of the GOP that is being given."""

    def put(self, unit: PassthroughUnit) -> None:
        """Take what has come; where nobody asks, the oldest goes."""
        self._units.append(unit)
        if len(self._units) > _MOST_GOPS * self._gop + _CUSHION:
            self._units.popleft()
            self._whole = False

    def take(self, pulse: int) -> PassthroughUnit | None:
        """Return what goes with a pulse; pulses must grow. None: nothing can."""
        begins = self._last is None or pulse // self._gop != self._last // self._gop
        skipped = self._last is not None and pulse != self._last + 1
        self._last = pulse
        if begins:
            # A GOP whose first pulse was missed is used by nobody.
            self._whole = pulse % self._gop == 0 and self._to_a_key()
        elif skipped or not self._units or self._units[0].key:
            self._whole = False  # what builds on what was not sent cannot be decoded
        return self._units.popleft() if self._whole else None

    def _to_a_key(self) -> bool:
        """Drop what is before the GOP that is to begin; tell whether one can begin now."""
        goes_on = self._whole and bool(self._units) and self._units[0].key
        behind = _TOO_LATE if goes_on else _CUSHION
        most = len(self._units) - 1 - behind
        keys = [place for place, unit in enumerate(self._units) if unit.key and place <= most]
        for _ in range(keys[-1] if keys else 0):
            self._units.popleft()
        return goes_on or bool(keys)
