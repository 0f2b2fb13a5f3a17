"""The video with boxes burnt in: encoded once for all viewers, on the site's timeline, with its audio."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Sequence
from itertools import pairwise

from server.media.containers.fmp4 import FragmentSample, fragment, init_segment
from server.media.h264.annexb import join_sample, parameter_sets
from server.media.nal_units import nal_units
from server.media.picture import EncodedPicture
from server.media.rendering_messages import EncodedFrame, RenderSettings
from server.media.stream_format import StreamFormat
from server.service.streaming.audio_buffer import AudioBuffer, AudioFollower
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.gapless_timeline import GaplessTimeline
from server.service.streaming.media_chunk import TsContinuity


class OverlayVideoPublisher:
    """Publishes encoded frames without gaps, also when the encoding process is replaced.

    ``audio_buffer`` is None if the site has no audio; ``mute_gaps``: the audio is muted while a gap is
    filled.
    """

    def __init__(
        self,
        settings: RenderSettings,
        queue_gops: int,
        audio_buffer: AudioBuffer | None = None,
        *,
        mute_gaps: bool = False,
    ) -> None:
        self._settings, self._ts = settings, TsContinuity(settings.fps)
        self._audio_format = None if audio_buffer is None else audio_buffer.format
        self._audio = None if audio_buffer is None else AudioFollower(audio_buffer)
        self._mute_gaps = mute_gaps
        self._stream_format = StreamFormat()
        self._timeline = GaplessTimeline(self._stream_format, settings.fps, settings.gop)
        self._process = 0
        self.broadcaster = Broadcaster(queue_gops=queue_gops)
        self.users = 0
        """The number of viewers, including those that wait for the first picture."""
        self.head: bytes | None = None
        """The init segment; None before the first keyframe."""
        self.head_settled = asyncio.Event()
        """Set when there is an init segment, or will never be one."""

    def put(self, frames: Sequence[EncodedFrame], *, is_muted: bool = False) -> None:
        """Publish the encoded frames of one request, behind the filler of a gap before them.

        ``is_muted``: with silence in place of the site's audio.
        """
        pictures = [shown for frame in frames for shown in self._timeline.push(self._picture(frame))]
        for gop in _gops(pictures):
            audio = None if self._audio is None else self._audio.next_audio(gop[0].pulse, gop[-1].until)
            is_filler = gop[0].pulse < frames[0].pulse
            if audio is not None and (is_muted or (self._mute_gaps and is_filler)):
                audio = audio.silenced
            self.broadcaster.publish(self._ts.chunk(gop, audio))

    def begin_process(self) -> None:
        """Record that another process encodes the following frames: they do not reference earlier ones."""
        self._process += 1

    def close(self) -> None:
        """End the video for all viewers."""
        self.broadcaster.close()
        self.head_settled.set()

    def _picture(self, frame: EncodedFrame) -> EncodedPicture:
        units, settings = nal_units(frame.data), self._settings
        if frame.key:
            self._stream_format.adopt_or_check(parameter_sets(units))
        if self.head is None and self._stream_format.parameters is not None:
            self.head = init_segment(
                self._stream_format.parameters, settings.width, settings.height, self._audio_format
            )
            self.head_settled.set()
        sample = FragmentSample(join_sample(units), frame.key, frame.duration)
        packed = fragment([sample], frame.pulse, settings.fps)
        return EncodedPicture(frame.pulse, frame.key, packed, self._process, frame.duration)


def _gops(pictures: Sequence[EncodedPicture]) -> Iterator[Sequence[EncodedPicture]]:
    """Yield the pictures split at keyframes, where a viewer may join."""
    starts = [place for place, picture in enumerate(pictures) if picture.key or not place]
    for start, end in pairwise([*starts, len(pictures)]):
        yield pictures[start:end]
