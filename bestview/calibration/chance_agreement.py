"""Walks in a wrong order of time: two cameras agree about them only by chance."""

from __future__ import annotations

from dataclasses import replace

from bestview.calibration.walk import Walk, WalkTrack


def time_reversed(walk: Walk) -> Walk:
    """Return the walk with time running backwards, within the same frames."""
    return replace(
        walk, tracks=tuple(WalkTrack(walk.end_frame - it.end_frame, it.boxes[::-1]) for it in walk.tracks)
    )


def halves_swapped(walk: Walk) -> Walk:
    """Return the walk with its second half before its first."""
    half = walk.end_frame // 2
    parts = []
    for it in walk.tracks:
        cut = min(max(half - it.first_frame, 0), len(it.boxes))
        parts += [WalkTrack(it.first_frame + walk.end_frame - half, it.boxes[:cut])] if cut > 1 else []
        parts += [WalkTrack(it.first_frame + cut - half, it.boxes[cut:])] if len(it.boxes) - cut > 1 else []
    return replace(walk, tracks=tuple(parts))
