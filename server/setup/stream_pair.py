"""Which of a camera's streams viewers get, and in which people are tracked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from server.setup.trial_messages import StreamProfile

_PASSES_THROUGH = "H264"
_LEAST_WIDTH, _LEAST_HEIGHT = 320, 240
"""Of a substream: in smaller pictures people far away are not found."""


@dataclass(frozen=True, slots=True)
class StreamPair:
    """The places of two streams in a list.

    Attributes:
        source: of the one that viewers get.
        substream: of the one in which people are tracked; None: in the same.
    """

    source: int
    substream: int | None


def propose_pair(profiles: Sequence[StreamProfile]) -> StreamPair:
    """Propose the largest H.264 stream, and the smallest one that shows people well enough.

    Raises:
        ValueError: there is no stream.
    """
    places = range(len(profiles))

    def pixels(place: int) -> int:
        return profiles[place].width * profiles[place].height

    passing = [place for place in places if profiles[place].codec.upper() == _PASSES_THROUGH]
    source = max(passing or places, key=pixels)
    smaller = [
        place
        for place in places
        if profiles[place].width >= _LEAST_WIDTH
        and profiles[place].height >= _LEAST_HEIGHT
        and pixels(place) < pixels(source)
        and profiles[place].address != profiles[source].address
    ]
    return StreamPair(source, min(smaller, key=pixels, default=None))
