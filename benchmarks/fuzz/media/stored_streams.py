"""Targets for streams of the service: rendering, and stored media."""

from __future__ import annotations

import zlib
from pathlib import Path
from random import Random

from benchmarks.fuzz.engine.fed_site import FPS, HEIGHT, STRIDE, WIDTH
from benchmarks.fuzz.engine.target import Target, folder
from benchmarks.fuzz.media.damaged_media import damage_media, stream
from server.media.audio.audio_format import AudioFormat
from server.media.rendering_messages import PictureKind, RenderRequest, RenderSettings
from server.service.recording.media_files import read_gops
from server.service.recording.playlist_file import RecordingPlaylist
from server.service.rendering.worker.stream_renderer import StreamRenderer
from server.service.time_shift.playback_audio import read_audio_frames

_DRAWN = STRIDE + 1
"""Frames of a GOP and the beginning of the next."""
_ENCODED_EVERY = 8
"""One input in so many is encoded, since opening an encoder takes half of the time."""


class RenderedStreams(Target):
    """Fragments that are decoded and rendered."""

    name = "media-drawing"

    def __init__(self) -> None:
        self._fragments = stream("h264", _DRAWN)

    def make(self, rng: Random) -> bytes:
        """Return fragments."""
        return damage_media(rng, self._fragments)

    def feed(self, data: bytes) -> bool:
        """Render the fragments."""
        settings = RenderSettings(
            width=WIDTH,
            height=HEIGHT,
            fps=FPS,
            gop=STRIDE,
            preset="ultrafast",
            crf=23,
            max_kbps=None,
            jpeg_quality=80,
        )
        boxes = [[(1, 2.0, 3.0, 20.0, 40.0)]] * _DRAWN
        hidden = [[(0.0, 1.0, 22.0, 50.0)]] * (_DRAWN - 1)
        video: PictureKind | None = "boxed" if zlib.crc32(data) % _ENCODED_EVERY == 0 else None
        drawn = StreamRenderer(settings).render(
            RenderRequest(fragments=data, boxes=boxes, hidden=hidden, video=video, boxed=[2.0], still="plain")
        )
        return drawn.newest >= 0


class StoredMedia(Target):
    """Damaged recordings: playlists and media files."""

    name = "media-recorded"
    _LIST = (
        b"#EXTM3U\n#EXTINF:0.2,p0+5\n#EXT-X-BYTERANGE:400@0\n../cameras/c0/000000000000.mp4\n"
        b"#EXTINF:0.2,p5+5\n#EXT-X-BYTERANGE:400@400\n../cameras/c1/000000000000.mp4\n#EXT-X-ENDLIST\n"
    )

    def __init__(self) -> None:
        self._stream = stream("h264")
        self._folder = folder()
        self._path = Path(self._folder.name)
        self._form = AudioFormat(48_000, 2)

    def make(self, rng: Random) -> bytes:
        """Return a playlist, or a media file."""
        return damage_media(rng, rng.choice((self._LIST, self._stream)))

    def feed(self, data: bytes) -> bool:
        """Parse the file."""
        path = self._path / "0.mp4"
        path.write_bytes(data)
        playlist = RecordingPlaylist(path, "../cameras/", "init.mp4", FPS, 0.0, 60.0)
        playlist.read()
        for stretch in playlist.index.between(0, 100):
            list(read_gops(path, stretch.offset, stretch.length, FPS, 5))
        found = list(read_gops(path, 0, len(data), FPS, 5))
        read_audio_frames(path, 0, len(data), 0, 20, self._form)
        return bool(found)

    def close(self) -> None:
        """Remove the folder."""
        self._folder.cleanup()
