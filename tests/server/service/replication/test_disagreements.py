"""Where two services' records differ, the one that follows changes exactly the people concerned."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.messaging.camera_identity_snapshot import CameraIdentitySnapshot, PersonSnapshot
from server.service.replication.disagreements import Disagreements, find_disagreements, numbers_of_tracks


def snapshots(tracks: Mapping[str, int]) -> dict[str, CameraIdentitySnapshot]:
    """Return records of tracks, named by camera and number ("a1"), and their people."""
    cameras = sorted({name[0] for name in tracks})
    return {
        camera: CameraIdentitySnapshot(
            pulse=9,
            boot=1,
            next_number=100,
            numbered_since=0.0,
            people=[
                PersonSnapshot(
                    number=number,
                    tracks=[int(name[1:]) for name in tracks if name[0] == camera and tracks[name] == number],
                )
                for number in sorted({tracks[name] for name in tracks if name[0] == camera})
            ],
        )
        for camera in cameras
    }


@pytest.mark.parametrize(
    ("own", "leading", "found"),
    [
        ({"a1": 1, "b1": 1}, {"a1": 1, "b1": 1}, Disagreements()),
        ({"a1": 1}, {"b1": 7}, Disagreements()),  # nothing in common
        ({"a1": 9, "b1": 9}, {"a1": 3, "b1": 3}, Disagreements(renumbered={9: 3})),
        ({"a1": 8, "a2": 9}, {"a1": 9, "a2": 8}, Disagreements(renumbered={8: 9, 9: 8})),
        ({"a1": 3, "b1": 9}, {"a1": 3, "b1": 3}, Disagreements(merged={9: 3})),
        ({"a1": 3, "b1": 3}, {"a1": 3, "b1": 4}, Disagreements(split={3: (("b",), 4)})),
        ({"a1": 3, "b1": 3}, {"a1": 5, "b1": 6}, Disagreements({3: 5}, {}, {3: (("b",), 6)})),
        ({"a1": 8, "a2": 9}, {"a1": 3, "a2": 3}, Disagreements(renumbered={8: 3})),
    ],
)
def test_a_disagreement_is_a_number_a_merge_or_a_split(
    own: dict[str, int], leading: dict[str, int], found: Disagreements
) -> None:
    assert (
        find_disagreements(numbers_of_tracks(snapshots(own)), numbers_of_tracks(snapshots(leading))) == found
    )


TRACKS = st.dictionaries(st.sampled_from(["a1", "a2", "a3", "b1", "b2", "c1"]), st.integers(1, 5))


@given(TRACKS, TRACKS)
def test_new_numbers_are_one_to_one_and_each_person_changes_in_one_way(
    own: dict[str, int], leading: dict[str, int]
) -> None:
    found = find_disagreements(numbers_of_tracks(snapshots(own)), numbers_of_tracks(snapshots(leading)))
    assert len(set(found.renumbered.values())) == len(found.renumbered)
    assert found.renumbered.keys().isdisjoint(found.merged)
    assert set(found.merged.values()).isdisjoint({*found.merged, *found.renumbered})
    common = numbers_of_tracks(snapshots(own)).keys() & numbers_of_tracks(snapshots(leading)).keys()
    same = {name: own[name] for name in own.keys() & leading.keys() if own[name] == leading[name]}
    assert bool(found) == (len(same) < len(common)) or not found
