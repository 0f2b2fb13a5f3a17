"""Frames of AAC or Opus by number (:mod:`server.media.audio.audio_format`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol, TypeAlias

import av
from av.audio.stream import AudioStream

Packet: TypeAlias = "av.Packet[AudioStream]"


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame."""

    number: int
    data: bytes


class Way(Protocol):
    """How a source's packets become the site's frames."""

    def take(self, packet: Packet, at: Fraction) -> list[Frame]:
        """Return what becomes whole by a packet that sounds ``at`` seconds after pulse 0; numbers grow."""
        ...


def runs(frames: Sequence[Frame]) -> Iterator[list[Frame]]:
    """Part frames into runs whose numbers follow each other."""
    run: list[Frame] = []
    for frame in frames:
        if run and frame.number != run[-1].number + 1:
            yield run
            run = []
        run.append(frame)
    if run:
        yield run
