"""Decoding of files, with FFmpeg's error messages."""

from __future__ import annotations

from pathlib import Path

import av
import av.logging
from av.video.codeccontext import VideoCodecContext

from server.media.picture import Codec


def decodes_without_errors(path: Path) -> None:
    """Decode all streams of a file or playlist; fail if FFmpeg logs an error."""
    before = av.logging.get_level()
    av.logging.set_level(av.logging.ERROR)
    try:
        with av.logging.Capture(local=False) as log, av.open(str(path)) as container:
            frames = sum(len(packet.decode()) for packet in container.demux())
    finally:
        av.logging.set_level(before)
    assert not log, f"{path}: {log}"
    assert frames, f"{path}: no pictures"


def video_decoder(codec: Codec) -> VideoCodecContext:
    """Return a decoder of a site's codec."""
    decoder = av.CodecContext.create("hevc" if codec == "h265" else codec, "r")
    assert isinstance(decoder, VideoCodecContext)
    return decoder
