"""Corrections of published person ids: merges, splits, and track swaps by an operator."""

from __future__ import annotations

from collections.abc import Collection, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass

from bestview.association.tracklet import TrackKey, Tracklet, TrackletKey
from bestview.association.tracklet_splitter import TrackletSplitter


@dataclass(frozen=True, slots=True, order=True)
class Merge:
    """Two ids turned out to be one person: `lost` is never used again."""

    kept: int
    lost: int


@dataclass(frozen=True, slots=True, order=True)
class Split:
    """A track that was published as one person turned out to be another, who may have been known before.

    The published person may not be visible any more. If two people swapped tracks, there are two splits.
    """

    published_id: int
    corrected_id: int
    camera: str


@dataclass(frozen=True, slots=True)
class IdentityUpdate:
    """Person ids after one update; every tuple is in rising order.

    Attributes:
        person_ids: the id of each tracklet that may still change; 0: none yet. A track is the person of its
            newest tracklet that has started.
        created: ids assigned for the first time.
        returned: ids of people who had departed and are back.
        departed: ids of people that no camera has seen for a while; they are remembered.
        merged: ids that turned out to be one person.
        split: tracks that turned out to show another person.
    """

    person_ids: Mapping[TrackletKey, int]
    created: tuple[int, ...]
    returned: tuple[int, ...]
    departed: tuple[int, ...]
    merged: tuple[Merge, ...]
    split: tuple[Split, ...]


class IdCorrections:
    """Detects splits by comparing each tracklet's id with the last published one."""

    def __init__(self) -> None:
        self._last: dict[TrackletKey, int] = {}

    def update(self, person_ids: Mapping[TrackletKey, int], merged: Sequence[Merge]) -> tuple[Split, ...]:
        """Return the splits since the last update; merged ids are not splits.

        A tracklet without an id, whose new person is not confirmed yet, is compared once it has one.
        """
        for merge in merged:
            self._last = {
                key: merge.kept if person_id == merge.lost else person_id
                for key, person_id in self._last.items()
            }
        splits = {
            Split(self._last[key], person_id, key.camera)
            for key, person_id in person_ids.items()
            if self._last.get(key, person_id) != person_id
        }
        self._last.update(person_ids)
        return tuple(sorted(splits))

    def renumber(self, ids: Mapping[int, int]) -> None:
        """Replace ids by others, one to one; these are no splits."""
        self._last = {key: ids.get(person_id, person_id) for key, person_id in self._last.items()}

    def forget(self, people: Collection[int]) -> None:
        """Forget what was published as these people: who comes after them is no split."""
        self._last = {key: person_id for key, person_id in self._last.items() if person_id not in people}

    def split_off(self, keys: Iterable[TrackletKey], person_id: int) -> None:
        """Store ids that an operator assigned, so that they are not reported as splits."""
        self._last.update((key, person_id) for key in keys if key in self._last)

    def reassign_each(self, changed: Mapping[TrackletKey, tuple[int, int]]) -> None:
        """Store ids that an operator assigned, given as ids before and after."""
        for key, (_, person_id) in changed.items():
            self.split_off([key], person_id)

    def keep_only(self, keys: Collection[TrackletKey]) -> None:
        """Forget all other tracklets."""
        self._last = {key: person_id for key, person_id in self._last.items() if key in keys}


def swap_tracks(
    tracklets: TrackletSplitter,
    people: Container[int],
    tracks: tuple[TrackKey, TrackKey],
    frame: int,
    ids_before: tuple[int, int],
) -> dict[TrackletKey, tuple[int, int]]:
    """Swap the people of two tracks from a frame on.

    A tracklet that started in that frame or later becomes the other track's person. If a track was not split
    since, its next observation starts a new tracklet. Tracklets of other cameras that started since and were
    assigned to one of the two are swapped as well.

    Args:
        tracklets: of all tracks; changed in place.
        people: ids of the remembered people.
        tracks: of one camera.
        frame: the first in which each track shows the other's person.
        ids_before: person ids of the two tracks before that frame, for tracklets that are settled and over.

    Returns:
        The ids before and after of each changed tracklet; a track that is split only later counts as if a
        tracklet had started in that frame. Empty if one of the two had no id.
    """
    first, second = (
        tracklets.predecessor(track, frame, id_before)
        for track, id_before in zip(tracks, ids_before, strict=True)
    )
    if first is None or second is None:
        return {}
    first_id, second_id = _id_of(first, people), _id_of(second, people)
    if not first_id or not second_id or first_id == second_id:
        return {}
    changed, already_wrong = {}, 0
    for track, predecessor, other_predecessor, person_id in (
        (tracks[0], first, second, second_id),
        (tracks[1], second, first, first_id),
    ):
        current = tracklets.current_if_started_since(track, frame)
        previous_id = _id_of(predecessor if current is None else current, people)
        already_wrong += previous_id == first_id + second_id - person_id
        if previous_id and previous_id != person_id:
            changed[TrackletKey(*track, frame) if current is None else current.key] = previous_id, person_id
        if current is None:
            tracklets.split_next(track, person_id, other_predecessor)
        else:
            current.continue_as(person_id, other_predecessor)
    if already_wrong == len(tracks):
        for tracklet in tracklets.active:
            previous_id = tracklet.person_id
            if (
                tracklet.start.frame >= frame
                and previous_id in {first_id, second_id}
                and tracklet.key.track not in tracks
            ):
                tracklet.reassign_id(first_id + second_id - previous_id)
                changed[tracklet.key] = previous_id, tracklet.person_id
    return changed


def _id_of(tracklet: Tracklet, people: Container[int]) -> int:
    """Return the person id of a tracklet, settled or not; 0: no remembered person."""
    person_id = tracklet.settled_id or tracklet.person_id or tracklet.main_id
    return person_id if person_id in people else 0
