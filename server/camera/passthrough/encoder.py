"""An encoder's stand-in that passes the source's access units through."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

from server.camera.encoding.encoder import AccessUnit
from server.camera.sources import PictureSource
from server.camera.sources.base import Image


@dataclass(frozen=True, slots=True)
class PassthroughUnit:
    """An access unit as it came, in Annex B, and its decoded picture."""

    key: bool
    data: bytes
    image: Image
    time: Fraction | None = None
    """When it was taken, seconds by the camera's clock; None: not known."""


class PassthroughSource(PictureSource, Protocol):
    """A source that keeps the access units of its pictures."""

    taken: PassthroughUnit | None
    """The unit of the picture taken last."""


class PassthroughEncoder:
    """Stands in for an encoder: returns the access unit of the picture that was taken."""

    def __init__(self, source: PassthroughSource) -> None:
        self._source = source

    def encode(self, pulse: int, image: Image) -> AccessUnit:
        """Return the access unit of a pulse, whose picture was the last one taken."""
        unit = self._source.taken
        if unit is None or unit.image is not image:
            raise RuntimeError("a picture was taken meanwhile")
        return AccessUnit(pulse, unit.key, unit.data)
