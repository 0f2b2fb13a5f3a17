"""Walks in a wrong order of time: what cameras agree about then, they agree about by chance."""

from __future__ import annotations

from dataclasses import replace

from bestview.calibration.walk import Track, Walk


def backwards(walk: Walk) -> Walk:
    """Give the same walk with time running backwards, within the same frames."""
    return replace(walk, tracks=tuple(Track(walk.end - it.end, it.boxes[::-1]) for it in walk.tracks))


def late(walk: Walk) -> Walk:
    """Give the same walk with its second half before its first."""
    half = walk.end // 2
    parts = []
    for it in walk.tracks:
        cut = min(max(half - it.first, 0), len(it.boxes))
        parts += [Track(it.first + walk.end - half, it.boxes[:cut])] if cut > 1 else []
        parts += [Track(it.first + cut - half, it.boxes[cut:])] if len(it.boxes) - cut > 1 else []
    return replace(walk, tracks=tuple(parts))
