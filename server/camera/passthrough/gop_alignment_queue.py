"""Queue of a network camera's access units, which aligns its GOPs with the site's."""

from __future__ import annotations

from collections import deque

from server.camera.passthrough.encoder import PassthroughUnit

_CUSHION = 2
"""Units to buffer behind the first one of a GOP, against network jitter."""
_SKIP_BEHIND = 2 * _CUSHION + 1
"""Units behind the next GOP's beginning from which the present GOP is skipped."""
_MAX_GOPS = 4


class GopAlignmentQueue:
    """A queue that hands out the first access unit of a GOP only at a pulse where a GOP begins.

    A camera begins its GOPs at any time, so units wait for up to a GOP and the cushion, and the camera is
    behind the others by that. As its clock drifts, occasionally a GOP is skipped, or a pulse has no unit and
    the remainder of its GOP is unusable.
    """

    def __init__(self, gop: int) -> None:
        self._gop = gop
        self._units: deque[PassthroughUnit] = deque()
        self._last: int | None = None
        self._is_intact = False
        """Whether no unit of the current GOP is missing."""

    def put(self, unit: PassthroughUnit) -> None:
        """Add a unit; when full, drop the oldest."""
        self._units.append(unit)
        if len(self._units) > _MAX_GOPS * self._gop + _CUSHION:
            self._units.popleft()
            self._is_intact = False

    def take(self, pulse: int) -> PassthroughUnit | None:
        """Return the unit of a pulse; None: there is none. Pulses must ascend."""
        begins = self._last is None or pulse // self._gop != self._last // self._gop
        skipped = self._last is not None and pulse != self._last + 1
        self._last = pulse
        if begins:
            # A GOP whose first pulse was missed cannot be used.
            self._is_intact = pulse % self._gop == 0 and self._seek_keyframe()
        elif skipped or not self._units or self._units[0].key:
            self._is_intact = False  # later units cannot be decoded without the missing one
        return self._units.popleft() if self._is_intact else None

    def _seek_keyframe(self) -> bool:
        """Drop the units before the next GOP; return whether one can begin now."""
        continues = self._is_intact and bool(self._units) and self._units[0].key
        behind = _SKIP_BEHIND if continues else _CUSHION
        most = len(self._units) - 1 - behind
        keys = [place for place, unit in enumerate(self._units) if unit.key and place <= most]
        for _ in range(keys[-1] if keys else 0):
            self._units.popleft()
        return continues or bool(keys)
