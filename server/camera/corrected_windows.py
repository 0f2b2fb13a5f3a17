"""What is told of a window that somebody's pointing has mended: no more than what is new or has changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tracking import WindowResult, WindowTrack, merge_results


def corrected_messages(result: WindowResult, anew: WindowResult) -> WindowResult:
    """Return what to publish where a correction has had a window solved again.

    It begins with the first frame that was told as final and has changed, or where nothing has with the first
    frame that was not final; ``revised_from`` says which.

    Args:
        result: of the window, which nobody was told of yet.
        anew: the same frames solved anew, and maybe more before them.
    """
    changed = anew.revised_from
    if changed is not None and changed < result.first:
        return _from(anew, changed)
    if anew.first <= result.first:
        return replace(_from(anew, result.first), revised_from=None)
    both = merge_results([result, anew])
    assert both is not None  # noqa: S101 — two make one
    return replace(both, revised_from=None)


def _from(result: WindowResult, first: int) -> WindowResult:
    """Leave out the frames before this one, and who is in none of the others."""
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
