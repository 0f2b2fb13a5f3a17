"""One camera's newest frames as container fragments, by pulse: every stream is composed of them."""

from __future__ import annotations

from server.media.parameter_sets import ParameterSets
from server.media.picture import EncodedPicture
from server.media.stream_format import StreamFormat


class DamagedFrameError(ValueError):
    """An access unit without a picture, or without the frame number that decoding needs."""


class FrameBuffer:
    """Keeps the last ``frames`` frames of one camera; each is packed into a fragment once, when it arrives.

    All frame buffers of a site share one stream format.
    """

    def __init__(self, fps: float, frames: int, stream_format: StreamFormat) -> None:
        self.fps = fps
        self._max_frames = frames
        self._stream_format = stream_format
        self._pictures: dict[int, EncodedPicture] = {}
        self._parameters: ParameterSets | None = None
        self.newest = -1

    def put(
        self, pulse: int, boot: int, access_unit: bytes, *, key: bool, reference_pulse: int | None = None
    ) -> EncodedPicture:
        """Store an access unit; ``reference_pulse`` is that of the picture that it references, if known.

        Raises:
            ParameterMismatchError: its parameter sets are not the site's, and the camera must be refused.
            DamagedFrameError: it is damaged; nothing is stored.
        """
        if key:
            self._parameters = self._stream_format.accept(access_unit)
        fragment = self._stream_format.pack(access_unit, pulse, self.fps, key=key)
        picture = EncodedPicture(
            pulse,
            key,
            fragment,
            boot,
            parameters=self._parameters,
            reference_pulse=reference_pulse,
            codec=self._stream_format.picture_codec,
        )
        gap_filler = self._stream_format.gap_filler(picture, self.fps)
        if gap_filler is not None and not gap_filler.can_read(picture):
            raise DamagedFrameError(f"no picture can be read in the access unit of pulse {pulse}")
        self._pictures[pulse] = picture
        self.newest = max(self.newest, pulse)
        while len(self._pictures) > self._max_frames:
            del self._pictures[next(iter(self._pictures))]
        return picture

    def lost(self, first: int, frames: int) -> list[int]:
        """Return which of ``first … first + frames - 1`` are missing between frames that arrived."""
        oldest = next(iter(self._pictures), self.newest + 1)
        pulses = range(max(first, oldest), min(first + frames, self.newest + 1))
        return [pulse for pulse in pulses if pulse not in self._pictures]

    def has(self, pulse: int) -> bool:
        """Return whether a frame is in the buffer."""
        return pulse in self._pictures

    def get(self, pulse: int) -> EncodedPicture | None:
        """Return one frame; None if it is not in the buffer."""
        return self._pictures.get(pulse)

    def pictures(self, first: int, frames: int) -> list[EncodedPicture]:
        """Return the frames of ``first … first + frames - 1`` that are in the buffer."""
        return [self._pictures[pulse] for pulse in range(first, first + frames) if pulse in self._pictures]
