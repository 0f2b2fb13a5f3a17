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
class EncodedAudioFrame:
    """One encoded audio frame and its number."""

    number: int
    data: bytes


class AudioFramer(Protocol):
    """Turns the packets of a source into numbered audio frames."""

    def take(self, packet: Packet, at: Fraction) -> list[EncodedAudioFrame]:
        """Return the frames that a packet completes; the packet plays ``at`` seconds after pulse 0."""
        ...


def consecutive_runs(frames: Sequence[EncodedAudioFrame]) -> Iterator[list[EncodedAudioFrame]]:
    """Split frames into runs of consecutive numbers."""
    run: list[EncodedAudioFrame] = []
    for frame in frames:
        if run and frame.number != run[-1].number + 1:
            yield run
            run = []
        run.append(frame)
    if run:
        yield run
