"""The frames to publish after an operator's correction: those that are new or have changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tracking import WindowResult, WindowTrack, merge_results


def corrected_messages(result: WindowResult, revised: WindowResult) -> WindowResult:
    """Return the result to publish after a correction caused a window to be solved again.

    It begins with the first frame that was published as final and has changed, else with the first frame that
    was not final; ``revised_from`` is set in the first case only.

    Args:
        result: the window's result before the correction, not published yet.
        revised: the result after it, which may begin earlier.
    """
    changed = revised.revised_from
    if changed is not None and changed < result.first:
        return _from(revised, changed)
    if revised.first <= result.first:
        return replace(_from(revised, result.first), revised_from=None)
    both = merge_results([result, revised])
    assert both is not None  # noqa: S101 — two make one
    return replace(both, revised_from=None)


def _from(result: WindowResult, first: int) -> WindowResult:
    """Drop the frames before ``first``, and the tracks without a box in the others."""
    if first <= result.first:
        return result
    tracks = [_cut(it, result.first, first) for it in result.tracks]
    seen = tuple(it for it in tracks if not np.isnan(it.boxes).all())
    return replace(result, first=first, tracks=seen)


def _cut(track: WindowTrack, begins: int, first: int) -> WindowTrack:
    samples = (it for it in track.appearance_samples if it.last >= first)
    kept = tuple(replace(it, first=max(it.first, first)) for it in samples)
    rows = slice(first - begins, None)
    return replace(
        track, boxes=track.boxes[rows], interpolated=track.interpolated[rows], appearance_samples=kept
    )
