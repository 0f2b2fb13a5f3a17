"""The two kinds of streams: a camera's, picture by picture, and one that is decided GOP by GOP."""

from __future__ import annotations

from collections.abc import Mapping

from server.media.containers.mpegts import Counters
from server.media.h264.annexb import ParameterSets
from server.media.picture import Picture
from server.media.stream_format import Agreement
from server.service.streaming.audio_buffer import AudioBuffer, AudioFollower
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.gapless_timeline import GaplessTimeline
from server.service.streaming.hls_segmenter import HlsSegmenter
from server.service.streaming.media_chunk import MediaChunk, TsContinuity
from server.service.streaming.presence import Presence


class LiveStream:
    """A camera's own stream: every picture at once."""

    def __init__(
        self, channel: Broadcaster, time: GaplessTimeline, fps: float, sound: AudioBuffer | None = None
    ) -> None:
        self.channel = channel
        self._time, self._tally = time, TsContinuity(fps)
        self._sound = None if sound is None else AudioFollower(sound)

    def take(self, frame: Picture) -> None:
        """Send a picture, after what bridges a hole before it."""
        for picture in self._time.take(frame):
            self._send([picture], fills=False)

    def fill(self, until: int) -> None:
        """Repeat the last picture, if there is one, up to a pulse."""
        self._send(self._time.fill(until), fills=True)

    def _send(self, pictures: list[Picture], *, fills: bool) -> None:
        if not pictures:
            return
        heard = None if self._sound is None else self._sound.beside(pictures[0].pulse, pictures[-1].until)
        self.channel.publish(self._tally.footage(pictures, heard, fills=fills))


class GopSequencer:
    """What one stream shows, GOP after GOP, each of one camera: there is no hole in its time."""

    def __init__(self, time: GaplessTimeline) -> None:
        self._time = time
        self._camera: str | None = None

    def show(self, camera: str | None, gop: GopAssembler) -> list[MediaChunk]:
        """Give a camera's GOP, or what bridges it where it is not whole or there is none."""
        before = self._time.fill(gop.first)
        shown = [gop.footage(before)] if before else []
        whole = None if camera is None else gop.whole(camera)
        self._camera = camera or self._camera
        if whole is not None:
            self._time.pass_by(whole.pictures[-1])
            return [*shown, whole]
        came = [] if self._camera is None else gop.pictures(self._camera)
        pictures = [it for picture in came for it in self._time.take(picture)]
        pictures += self._time.fill(gop.until)
        return [*shown, gop.footage(pictures)] if pictures else shown

    def hold(self, gop: GopAssembler) -> list[MediaChunk]:
        """Return what repeats the last picture for a GOP; a grey GOP where it cannot be repeated."""
        self._camera = None  # whatever comes of it late is not for this stream any more
        before, held = self._time.fill(gop.first), self._time.fill(gop.until)
        shown = [gop.footage(it, silent=True) for it in (before, held) if it]
        return shown if held else [*shown, *self.blank(gop)]

    def blank(self, gop: GopAssembler) -> list[MediaChunk]:
        """Return a grey GOP, after what bridges a hole before it."""
        self._camera = None
        before = self._time.fill(gop.first)
        shown = [gop.footage(before, silent=True)] if before else []
        grey = gop.blank(self._time.agreement, self._time.newest)
        if grey is None:
            return shown
        self._time.pass_by(grey.pictures[-1])
        return [*shown, grey]


class SplicedStream:
    """A stream of whole GOPs, each of one camera; those that many streams show are put together once.

    ``reel`` keeps the newest of them.
    """

    def __init__(self, channel: Broadcaster, time: GaplessTimeline, reel: HlsSegmenter) -> None:
        self.channel, self.reel = channel, reel
        self._showing = GopSequencer(time)

    def show(self, camera: str | None, gop: GopAssembler, presence: Presence = Presence.PRESENT) -> None:
        """Send a camera's GOP, or what bridges it where it is not whole or there is none.

        Who is not present is not shown: the last picture stands, or grey.
        """
        match presence:
            case Presence.PRESENT:
                shown = self._showing.show(camera, gop)
            case Presence.HELD:
                shown = self._showing.hold(gop)
            case Presence.ABSENT:
                shown = self._showing.blank(gop)
        for footage in shown:
            self.reel.put(footage)
            self.channel.publish(footage)

    def close(self) -> None:
        """End the stream."""
        self.reel.end()
        self.channel.close()


class GopAssembler:
    """What the cameras have of the frames ``first … first + frames - 1``; ``tables`` counts GOPs."""

    def __init__(
        self,
        shelves: Mapping[str, FrameBuffer],
        first: int,
        frames: int,
        fps: float,
        tables: int,
        sound: AudioBuffer | None = None,
    ) -> None:
        self._sound = sound
        self._heard = None if sound is None else sound.between(first, first + frames)
        self.first, self.until = first, first + frames
        self._shelves, self._fps, self._tables = shelves, fps, tables
        self._whole: dict[str, MediaChunk | None] = {}
        self._grey: dict[ParameterSets | None, MediaChunk | None] = {}

    def pictures(self, camera: str) -> list[Picture]:
        """Give the pictures that have come."""
        return self._shelves[camera].pictures(self.first, self.until - self.first)

    def whole(self, camera: str) -> MediaChunk | None:
        """Give a camera's GOP, the same to all who ask; None where a picture is missing."""
        if camera not in self._whole:
            pictures = self.pictures(camera)
            is_whole = len(pictures) == self.until - self.first and pictures[0].key
            self._whole[camera] = self.footage(pictures) if is_whole else None
        return self._whole[camera]

    def blank(self, agreement: Agreement, newest: Picture | None) -> MediaChunk | None:
        """Return a grey GOP that fits after a picture, the same to all of one format; None: there is none."""
        form = None if newest is None else newest.parameters
        if form not in self._grey:
            pictures = agreement.blank(newest, self.first, self.until - self.first, self._fps)
            self._grey[form] = self.footage(pictures, silent=True) if pictures else None
        return self._grey[form]

    def footage(self, pictures: list[Picture], *, silent: bool = False) -> MediaChunk:
        """Put pictures of these frames together; where they are ``silent``, without the site's sound."""
        first, until = pictures[0].pulse, pictures[-1].until
        heard = self._heard  # of all its frames, shared by all who show them
        if self._sound is not None and (first, until) != (self.first, self.until):
            heard = self._sound.between(first, until)
        if silent and heard is not None:
            heard = heard.silenced
        fills, counters = not pictures[0].key, Counters(self._tables)
        return MediaChunk(pictures, self._fps, counters, fills=fills, heard=heard, silent=silent)
