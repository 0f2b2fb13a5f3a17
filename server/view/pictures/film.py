"""The film with boxes: encoded once, in fragments at the pulses' times, for any number of viewers."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from server.view.channel import Channel, Chunk
from server.view.fmp4 import Sample, fragment, init_segment
from server.view.h264 import nal_units, parameter_sets, sample
from server.wire.drawing import Canvas, Unit


class Film:
    """Takes GOPs as they are encoded. It survives the process that encodes: times never go back."""

    def __init__(self, canvas: Canvas, queue_gops: int) -> None:
        self._canvas = canvas
        self._last = -1
        self._whole = False
        """What comes next can be decoded after what went before."""
        self.channel = Channel(queue_starts=queue_gops)
        self.wanted = 0
        """How many watch, or wait for its beginning."""
        self.head: bytes | None = None
        """The init segment; None before the first key frame."""
        self.begun = asyncio.Event()
        """There is a head, or there will never be one."""

    def put(self, units: Sequence[Unit]) -> None:
        """Pass on encoded frames of one request."""
        fragments = [self._fragment(unit) for unit in units if self._goes_on(unit)]
        if fragments:
            self.channel.publish(Chunk(b"".join(fragments), start=True))

    def interrupted(self) -> None:
        """Another process goes on from here: what it encodes is of use from its first new key frame on."""
        self._whole = False

    def close(self) -> None:
        """End it for everybody."""
        self.channel.close()
        self.begun.set()

    def _goes_on(self, unit: Unit) -> bool:
        new = unit.pulse > self._last
        self._whole = new and (self._whole or unit.key)
        return self._whole

    def _fragment(self, unit: Unit) -> bytes:
        units, canvas = nal_units(unit.data), self._canvas
        self._last = unit.pulse
        if self.head is None and (parameters := parameter_sets(units)) is not None:
            self.head = init_segment(parameters, canvas.width, canvas.height)
            self.begun.set()
        return fragment([Sample(sample(units), unit.key)], unit.pulse, canvas.fps)
