"""One camera's newest frames as fragments, by pulse: what every stream takes from."""

from __future__ import annotations

from typing import TypeAlias

from server.media.h264.annexb import ParameterSets
from server.media.picture import Picture
from server.media.stream_format import Agreement

Shelved: TypeAlias = Picture
"""One frame, ready to be sent to anybody."""


class UndecodableFrameError(ValueError):
    """An access unit in which there is no picture, or none that says what it follows."""


class FrameBuffer:
    """Keeps the last ``frames`` frames of one camera; each is made into a fragment once, when it comes.

    All shelves of a site have one ``agreement`` about what its streams are made of.
    """

    def __init__(self, fps: float, frames: int, agreement: Agreement) -> None:
        self._fps = fps
        self._frames = frames
        self._agreement = agreement
        self._shelved: dict[int, Shelved] = {}
        self._parameters: ParameterSets | None = None
        self.newest = -1

    def put(
        self, pulse: int, boot: int, access_unit: bytes, *, key: bool, after: int | None = None
    ) -> Shelved:
        """Shelve an access unit; ``after`` is the pulse of the one that it is decoded by, if that is known.

        Raises:
            ParameterMismatchError: its parameters are not the site's, and the camera must be refused.
            NoPictureError: it is damaged; nothing is shelved.
        """
        if key:
            self._parameters = self._agreement.accept(access_unit)
        made = self._agreement.pack(access_unit, pulse, self._fps, key=key)
        shelved = Shelved(pulse, key, made, boot, parameters=self._parameters, after=after)
        bridge = self._agreement.bridge(shelved, self._fps)
        if bridge is not None and not bridge.can_follow(shelved):
            raise UndecodableFrameError(f"no picture can be read in the access unit of pulse {pulse}")
        self._shelved[pulse] = shelved
        self.newest = max(self.newest, pulse)
        while len(self._shelved) > self._frames:
            del self._shelved[next(iter(self._shelved))]
        return shelved

    def lost(self, first: int, frames: int) -> list[int]:
        """List the pulses among these whose frames did not come, though earlier and later ones did."""
        oldest = next(iter(self._shelved), self.newest + 1)
        span = range(max(first, oldest), min(first + frames, self.newest + 1))
        return [pulse for pulse in span if pulse not in self._shelved]

    def has(self, pulse: int) -> bool:
        """Tell whether the frame is here."""
        return pulse in self._shelved

    def get(self, pulse: int) -> Shelved | None:
        """Give one frame."""
        return self._shelved.get(pulse)

    def pictures(self, first: int, frames: int) -> list[Shelved]:
        """Give those of some consecutive frames that are here."""
        return [self._shelved[pulse] for pulse in range(first, first + frames) if pulse in self._shelved]

    def gop(self, first: int, frames: int) -> bytes:
        """Give the fragments of consecutive frames in one piece; all of them must be here."""
        return b"".join(self._shelved[pulse].fragment for pulse in range(first, first + frames))
