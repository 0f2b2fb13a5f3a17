"""Occlusions in ground truth, and whether ids survive them."""

from __future__ import annotations

import pytest

from tracking.evaluation import Occlusion, find_occlusions, identities_kept
from tracking.motchallenge import MotRow


def seen(number: int, frames: range, visible: float = 1.0, left: float = 100.0) -> list[MotRow]:
    return [MotRow(frame, number, left, 50.0, 20.0, 60.0, visible=visible) for frame in frames]


HIDDEN = seen(1, range(1, 11)) + seen(1, range(11, 16), 0.2) + seen(1, range(16, 30))


def test_a_person_visible_by_less_than_a_quarter_between_two_sightings_is_occluded() -> None:
    assert find_occlusions(HIDDEN, around=10) == [Occlusion(1, 11, 15)]


def test_without_a_sighting_before_and_after_there_is_no_occlusion() -> None:
    assert find_occlusions([row for row in HIDDEN if row.frame < 16], around=10) == []
    assert find_occlusions([row for row in HIDDEN if row.frame > 10], around=10) == []


def test_two_visible_frames_do_not_end_an_occlusion() -> None:
    rows = [
        MotRow(row.frame, 1, row.left, row.top, row.width, row.height, visible=0.9)
        if row.frame in {12, 13}
        else row
        for row in HIDDEN
    ]
    assert find_occlusions(rows, around=10) == [Occlusion(1, 11, 15)]


def test_without_visible_shares_the_person_with_lower_feet_occludes_the_other() -> None:
    passer_by = [MotRow(frame, 2, 10.0 * frame, 55.0, 20.0, 60.0) for frame in range(1, 25)]
    found = find_occlusions(seen(1, range(1, 25), -1.0) + passer_by, around=10)
    # The box at 10 f covers more than half of the 20 pixels from 100 on at f = 10 alone.
    assert found == [Occlusion(1, 10, 10)]


def test_the_annotated_visibility_counts_in_addition_to_the_boxes() -> None:
    rows = seen(1, range(1, 11)) + seen(1, range(11, 16), 0.0) + seen(1, range(16, 30))
    assert find_occlusions(rows, around=10) == [Occlusion(1, 11, 15)]


def test_truth_rows_with_confidence_zero_occlude_no_one() -> None:
    ghost = [MotRow(frame, 2, 100.0, 55.0, 20.0, 60.0, confidence=0.0) for frame in range(8, 12)]
    assert find_occlusions(seen(1, range(1, 25), -1.0) + ghost, around=10) == []


@pytest.mark.parametrize(
    ("before", "after", "kept"),
    [(7, 7, True), (7, 8, False), (None, 7, False), (7, None, False)],
)
def test_an_id_is_kept_if_it_is_the_same_before_and_after(
    before: int | None, after: int | None, kept: bool
) -> None:
    tracks = [] if before is None else seen(before, range(3, 11))
    tracks += [] if after is None else seen(after, range(18, 30))
    found = find_occlusions(HIDDEN, around=10)
    assert identities_kept(found, HIDDEN, tracks, around=10) == [kept]


def test_the_id_of_most_frames_after_the_occlusion_counts() -> None:
    tracks = seen(7, range(1, 11)) + seen(8, range(16, 18)) + seen(7, range(18, 30))
    assert identities_kept(find_occlusions(HIDDEN, around=10), HIDDEN, tracks, around=10) == [True]
