"""Validation of cameras' messages beyond their format: the pipeline relies on their consistency."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from server.messaging.epochs import end_of_epoch
from server.messaging.messages import CameraTracks
from server.messaging.packed_arrays import are_boxes, histogram_bins

_WINDOW_MAX = 100_000
"""Limit of frames in one message: far more than any window, or any gap that a tracker bridges."""


def is_plausible(message: CameraTracks, stride: int) -> bool:
    """Return whether the frames, the tracks and the sizes in a message are consistent."""
    frames, end = message.last - message.first + 1, end_of_epoch(message.epoch, stride)
    ids = [track.id for track in message.tracks]
    samples = [sample for track in message.tracks for sample in track.appearance]
    bins = [histogram_bins(sample.histogram) for sample in samples]
    return (
        0 <= frames <= _WINDOW_MAX
        and message.final_to <= message.last <= end
        and all(
            _are_valid_frames(pulses, end)
            for pulses in (message.shed, message.without_detection, message.without_peers)
        )
        and len(ids) == len(dict.fromkeys(ids))
        and all(count and count == bins[0] for count in bins)
        and are_boxes([track.boxes for track in message.tracks], frames)
        and (message.revised_from is None or message.first <= message.revised_from <= message.final_to)
        and all(message.first <= sample.first <= sample.last <= message.final_to for sample in samples)
        and _are_valid_observations(message, end)
    )


def _are_valid_observations(message: CameraTracks, end: int) -> bool:
    """Return whether observations are of an epoch's frames, in order."""
    pulses = [frame.pulse for frame in message.observations]
    return _are_valid_frames(pulses, end) and all(before < pulse for before, pulse in pairwise(pulses))


def _are_valid_frames(pulses: Sequence[int], end: int) -> bool:
    """Return whether these can be frames of an epoch that ends with a pulse."""
    return len(pulses) <= _WINDOW_MAX and max(pulses, default=-1) <= end
