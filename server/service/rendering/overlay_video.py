"""The film with boxes: encoded once for all viewers, at the pulses' times, with the site's sound."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Sequence
from itertools import pairwise

from server.media.containers.fmp4 import FragmentSample, fragment, init_segment
from server.media.h264.annexb import join_sample, nal_units, parameter_sets
from server.media.picture import EncodedPicture
from server.media.rendering_messages import Canvas, EncodedFrame
from server.media.stream_format import StreamFormat
from server.service.streaming.audio_buffer import AudioBuffer, AudioFollower
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.gapless_timeline import GaplessTimeline
from server.service.streaming.media_chunk import TsContinuity


class OverlayVideo:
    """Takes frames as they are encoded. Processes come and go: its time has no hole and never goes back.

    ``sound`` is None at a site without; ``silent_holes``: it is not heard while a hole is bridged.
    """

    def __init__(
        self,
        canvas: Canvas,
        queue_gops: int,
        sound: AudioBuffer | None = None,
        *,
        silent_holes: bool = False,
    ) -> None:
        self._canvas, self._tally = canvas, TsContinuity(canvas.fps)
        self._format = None if sound is None else sound.format
        self._sound = None if sound is None else AudioFollower(sound)
        self._silent_holes = silent_holes
        self._stream_format = StreamFormat()
        self._time = GaplessTimeline(self._stream_format, canvas.fps, canvas.gop)
        self._process = 0
        self.channel = Broadcaster(queue_gops=queue_gops)
        self.wanted = 0
        """How many watch, or wait for its beginning."""
        self.head: bytes | None = None
        """The init segment; None before the first key frame."""
        self.begun = asyncio.Event()
        """There is a head, or there will never be one."""

    def put(self, units: Sequence[EncodedFrame], *, silent: bool = False) -> None:
        """Pass on encoded frames of one request, after what bridges a hole before them.

        Where they are ``silent``, the site's sound is not heard meanwhile.
        """
        pictures = [shown for unit in units for shown in self._time.push(self._picture(unit))]
        for gop in _gops(pictures):
            heard = None if self._sound is None else self._sound.next_audio(gop[0].pulse, gop[-1].until)
            bridged = gop[0].pulse < units[0].pulse
            if heard is not None and (silent or (self._silent_holes and bridged)):
                heard = heard.silenced
            self.channel.publish(self._tally.chunk(gop, heard))

    def interrupted(self) -> None:
        """Another process goes on from here: what it encodes builds on nothing that was before."""
        self._process += 1

    def close(self) -> None:
        """End it for everybody."""
        self.channel.close()
        self.begun.set()

    def _picture(self, unit: EncodedFrame) -> EncodedPicture:
        units, canvas = nal_units(unit.data), self._canvas
        if unit.key:
            self._stream_format.check(parameter_sets(units))
        if self.head is None and self._stream_format.parameters is not None:
            self.head = init_segment(
                self._stream_format.parameters, canvas.width, canvas.height, self._format
            )
            self.begun.set()
        made = fragment([FragmentSample(join_sample(units), unit.key, unit.lasts)], unit.pulse, canvas.fps)
        return EncodedPicture(unit.pulse, unit.key, made, self._process, unit.lasts)


def _gops(pictures: Sequence[EncodedPicture]) -> Iterator[Sequence[EncodedPicture]]:
    """Part pictures where key frames are: a viewer may begin there."""
    starts = [place for place, picture in enumerate(pictures) if picture.key or not place]
    for start, end in pairwise([*starts, len(pictures)]):
        yield pictures[start:end]
