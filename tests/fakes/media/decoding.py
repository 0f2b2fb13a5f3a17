"""Decode a file as a player does, and listen to what FFmpeg says of it."""

from __future__ import annotations

from pathlib import Path

import av
import av.logging


def decodes_without_errors(path: Path) -> None:
    """Decode every stream of a file or playlist to its end, without one error that FFmpeg reports."""
    before = av.logging.get_level()
    av.logging.set_level(av.logging.ERROR)
    try:
        with av.logging.Capture(local=False) as said, av.open(str(path)) as opened:
            frames = sum(len(packet.decode()) for packet in opened.demux())
    finally:
        av.logging.set_level(before)
    assert not said, f"{path}: {said}"
    assert frames, f"{path}: no pictures"
