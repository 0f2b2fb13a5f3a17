"""Takes the place of an encoder where the source's access units are passed through."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

from server.camera.encoder import AccessUnit
from server.camera.sources import FrameSource
from server.camera.sources.base import Image
from server.camera.sources.stream_clock import CaptureTime


@dataclass(frozen=True, slots=True)
class PassthroughUnit:
    """An unchanged access unit of the source, in Annex B."""

    key: bool
    data: bytes
    image: Image | None
    """None: it was not decoded."""
    time: Fraction | None = None
    """Its time stamp, seconds; None: unknown."""
    captured: CaptureTime | None = None
    """When it was captured; None: unknown."""


class PassthroughSource(FrameSource, Protocol):
    """A source that also has the access units of its images."""

    current: PassthroughUnit | None
    """The access unit of the pulse that was taken last; None: it has none."""
    decodes: bool
    """Whether access units are decoded; a change applies from the next keyframe on."""


class PassthroughEncoder:
    """Returns the source's access unit instead of encoding the image."""

    def __init__(self, source: PassthroughSource) -> None:
        self._source = source

    def encode(self, pulse: int, image: Image | None) -> AccessUnit:
        """Return the access unit of a pulse, which was the last one taken, with this image if any."""
        unit = self._source.current
        if unit is None or unit.image is not image:
            raise RuntimeError("another image has been taken since")
        return AccessUnit(pulse, unit.key, unit.data)
