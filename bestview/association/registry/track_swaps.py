"""Operator correction: two tracks of a camera swapped their people."""

from __future__ import annotations

from collections.abc import Container

from bestview.association.keys import TrackKey, TrackletKey
from bestview.association.tracklet import Tracklet
from bestview.association.tracklet_splitter import TrackletSplitter


def swap_tracks(
    tracklets: TrackletSplitter,
    people: Container[int],
    tracks: tuple[TrackKey, TrackKey],
    frame: int,
    person_ids: tuple[int, int],
) -> dict[TrackletKey, tuple[int, int]]:
    """Let each of two tracks continue, from a frame on, what the other one was before.

    The tracklet that started in that frame or later becomes the other's person. If a track was not split
    since, its next observation starts a new tracklet. Tracklets of other cameras that started since and were
    taken for one of the two are swapped as well.

    Args:
        tracklets: all of them; changed in place.
        people: the ids of those who are remembered.
        tracks: of one camera.
        frame: the first in which each of the two shows the other's person.
        person_ids: of the people before it, if that is settled and over.

    Returns:
        The ids before and after of each tracklet that has another one now; of a track that is split only
        later as if a tracklet had started in that frame. Empty if one of the two had no id.
    """
    first, second = (
        tracklets.predecessor(track, frame, number) for track, number in zip(tracks, person_ids, strict=True)
    )
    if first is None or second is None:
        return {}
    first_id, second_id = _id_of(first, people), _id_of(second, people)
    if not first_id or not second_id or first_id == second_id:
        return {}
    changed, already_wrong = {}, 0
    for track, own_part, other_part, number in (
        (tracks[0], first, second, second_id),
        (tracks[1], second, first, first_id),
    ):
        current = tracklets.started_since(track, frame)
        previous_id = _id_of(own_part if current is None else current, people)
        already_wrong += previous_id == first_id + second_id - number
        if previous_id and previous_id != number:
            changed[TrackletKey(*track, frame) if current is None else current.key] = previous_id, number
        if current is None:
            tracklets.split_next(track, number, other_part)
        else:
            current.continue_as(number, other_part)
    if already_wrong == len(tracks):
        for tracklet in tracklets.active:
            previous_id = tracklet.person_id
            if (
                tracklet.start.frame >= frame
                and previous_id in {first_id, second_id}
                and tracklet.key.track not in tracks
            ):
                tracklet.assign_id(first_id + second_id - previous_id)
                changed[tracklet.key] = previous_id, tracklet.person_id
    return changed


def _id_of(tracklet: Tracklet, people: Container[int]) -> int:
    """Return the person of a tracklet, settled or not; 0: none who is remembered."""
    number = tracklet.settled_id or tracklet.person_id or tracklet.main_id
    return number if number in people else 0
