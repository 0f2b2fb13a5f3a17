"""Decoding of files, with FFmpeg's error messages."""

from __future__ import annotations

from pathlib import Path

import av
import av.logging


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
