"""The temporal consistency benchmark: counting of merges, and rendering of the overhead room."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.temporal_consistency.__main__ import follow, main
from benchmarks.temporal_consistency.blob_merges import NOBODY, count_wrong_ids, events, find_merges
from benchmarks.temporal_consistency.overhead_room import OverheadClip, render_sequence
from tracking.baselines.temporal_consistency import TemporalSettings

# Two people meet at the third stage and part at the fifth; the third person is by themselves.
_BLOBS = np.array([[0, 1, 2], [0, 1, 2], [0, 0, 1], [0, 0, 1], [0, 1, 2], [0, 1, 2]])


def _told(*swapped: int) -> list[dict[int, int]]:
    """Return numbers as people have them, but with two exchanged in some stages."""
    order = [[1, 0, 2] if stage in swapped else [0, 1, 2] for stage in range(len(_BLOBS))]
    return [dict(enumerate(row[own].tolist(), 1)) for row, own in zip(_BLOBS, order, strict=True)]


def test_a_merge_of_two_is_one_merge_and_two_chances() -> None:
    found = find_merges(_BLOBS)
    assert [(merge.person, merge.inside) for merge in found] == [(0, (2, 4)), (1, (2, 4))]
    assert events(found, _BLOBS) == 1


def test_three_who_join_one_after_the_other_are_one_merge() -> None:
    blobs = np.array([[0, 1, 2], [0, 0, 1], [0, 0, 0], [0, 1, 1], [0, 1, 2]])
    found = find_merges(blobs)
    assert len(found) == 3
    assert events(found, blobs) == 1


@pytest.mark.parametrize("minutes", ["1", "nan", "inf"])
def test_clips_in_which_nobody_can_have_met_and_parted_are_refused(
    minutes: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["temporal", "--minutes", minutes])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert "--minutes: 8 at least" in capsys.readouterr().err


def test_a_merge_that_does_not_end_is_no_chance() -> None:
    assert not find_merges(_BLOBS[:4])
    assert not find_merges(_BLOBS[2:])


def test_who_is_seen_nowhere_for_a_moment_is_still_merged() -> None:
    blobs = _BLOBS.copy()
    blobs[3, 0] = NOBODY
    assert (0, (2, 3)) in [(merge.person, merge.inside) for merge in find_merges(blobs)]


def test_an_exchange_after_the_merge_is_two_mistakes_and_one_within_it_none() -> None:
    found = find_merges(_BLOBS)
    assert count_wrong_ids(found, _BLOBS, _told()) == [False, False]
    assert count_wrong_ids(found, _BLOBS, _told(4, 5)) == [True, True]
    assert count_wrong_ids(found, _BLOBS, _told(2, 3)) == [False, False]


def test_who_was_exchanged_before_and_stays_so_is_not_mistaken_again() -> None:
    assert count_wrong_ids(find_merges(_BLOBS), _BLOBS, _told(*range(6))) == [False, False]


def test_a_number_that_is_left_behind_is_a_mistake_of_whose_it_was() -> None:
    tracked = _told()
    for stage in (4, 5):
        tracked[stage][2] = 0  # both numbers go on with the first person
    assert count_wrong_ids(find_merges(_BLOBS), _BLOBS, tracked) == [False, True]


@pytest.mark.parametrize("stages", [1, 5])
def test_two_people_are_followed_through_the_room_from_above(stages: int) -> None:
    sequence, low_color = render_sequence(OverheadClip(2, 0.5, 1), 0.5, (1.0, 0.25))
    shares = [
        np.mean([blob.colors.max() for stage in kind.stages for blob in stage.blobs])
        for kind in (sequence, low_color)
    ]
    assert shares[0] < shares[1], "with little color everything falls into a few bins"
    assert len(sequence.stages) == len(sequence.blobs) > 40
    assert (sequence.blobs == NOBODY).mean() < 0.02
    tracked = follow(sequence, TemporalSettings(window_stages=stages, closed_world=True))
    assert len(tracked) == len(sequence.stages)
    alone = [place for place, row in enumerate(sequence.blobs) if row[0] != row[1] and NOBODY not in row]
    apart = [len(set(tracked[place].values())) == 2 for place in alone]
    assert np.mean(apart) > 0.9
