"""The temporal consistency benchmark: counting of merges, and rendering of the overhead room."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.temporal_consistency.__main__ import main, track_sequence
from benchmarks.temporal_consistency.blob_merges import NO_BLOB, count_merges, count_wrong_ids, find_merges
from benchmarks.temporal_consistency.overhead_room import OverheadClip, render_sequence
from tracking.baselines.temporal_consistency import TemporalSettings

# Two people meet at the third stage and part at the fifth; the third person is always alone.
_BLOBS = np.array([[0, 1, 2], [0, 1, 2], [0, 0, 1], [0, 0, 1], [0, 1, 2], [0, 1, 2]])


def _tracked(*swapped: int) -> list[dict[int, int]]:
    """Return the blobs by id: the true ones, but with two ids exchanged in some stages."""
    order = [[1, 0, 2] if stage in swapped else [0, 1, 2] for stage in range(len(_BLOBS))]
    return [dict(enumerate(row[people].tolist(), 1)) for row, people in zip(_BLOBS, order, strict=True)]


def test_a_merge_of_two_is_one_merge_and_two_chances() -> None:
    found = find_merges(_BLOBS)
    assert [(merge.person, merge.inside) for merge in found] == [(0, (2, 4)), (1, (2, 4))]
    assert count_merges(found, _BLOBS) == 1


def test_three_people_joining_one_after_the_other_are_one_merge() -> None:
    blobs = np.array([[0, 1, 2], [0, 0, 1], [0, 0, 0], [0, 1, 1], [0, 1, 2]])
    found = find_merges(blobs)
    assert len(found) == 3
    assert count_merges(found, blobs) == 1


@pytest.mark.parametrize("minutes", ["1", "nan", "inf"])
def test_clips_too_short_for_a_merge_are_refused(
    minutes: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["temporal", "--minutes", minutes])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert "--minutes: at least 8" in capsys.readouterr().err


def test_a_merge_without_beginning_or_end_is_not_counted() -> None:
    assert not find_merges(_BLOBS[:4])
    assert not find_merges(_BLOBS[2:])


def test_a_person_without_a_blob_for_a_stage_is_still_merged() -> None:
    blobs = _BLOBS.copy()
    blobs[3, 0] = NO_BLOB
    assert (0, (2, 3)) in [(merge.person, merge.inside) for merge in find_merges(blobs)]


def test_an_exchange_after_a_merge_is_two_errors_and_within_it_none() -> None:
    found = find_merges(_BLOBS)
    assert count_wrong_ids(found, _BLOBS, _tracked()) == [False, False]
    assert count_wrong_ids(found, _BLOBS, _tracked(4, 5)) == [True, True]
    assert count_wrong_ids(found, _BLOBS, _tracked(2, 3)) == [False, False]


def test_ids_exchanged_before_and_after_a_merge_are_no_errors() -> None:
    assert count_wrong_ids(find_merges(_BLOBS), _BLOBS, _tracked(*range(6))) == [False, False]


def test_a_lost_id_is_an_error_of_the_person_who_had_it() -> None:
    tracked = _tracked()
    for stage in (4, 5):
        tracked[stage][2] = 0  # both ids follow the first person
    assert count_wrong_ids(find_merges(_BLOBS), _BLOBS, tracked) == [False, True]


@pytest.mark.parametrize("stages", [1, 5])
def test_two_people_are_tracked_in_the_overhead_room(stages: int) -> None:
    sequence, low_color = render_sequence(OverheadClip(2, 0.5, 1), 0.5, (1.0, 0.25))
    shares = [
        np.mean([blob.colors.max() for stage in rendered.stages for blob in stage.blobs])
        for rendered in (sequence, low_color)
    ]
    assert shares[0] < shares[1], "at low saturation, colors fall into few bins"
    assert len(sequence.stages) == len(sequence.blobs) > 40
    assert (sequence.blobs == NO_BLOB).mean() < 0.02
    tracked = track_sequence(sequence, TemporalSettings(window_stages=stages, closed_world=True))
    assert len(tracked) == len(sequence.stages)
    alone = [stage for stage, row in enumerate(sequence.blobs) if row[0] != row[1] and NO_BLOB not in row]
    separated = [len(set(tracked[stage].values())) == 2 for stage in alone]
    assert np.mean(separated) > 0.9
