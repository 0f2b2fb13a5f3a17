"""Track scores: a small example, ignored people, and the oracle association."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from pathlib import Path

import pytest

from tracking.evaluation import Scores, TruthAndTracks, evaluate, evaluate_cameras, oracle_association
from tracking.motchallenge import MotRow, read_rows

NEAR, FAR = 0.0, 500.0


def box(frame: int, number: int, left: float, confidence: float = 1.0) -> MotRow:
    return MotRow(frame, number, left, 0.0, 40.0, 100.0, confidence)


def stay(number: int, left: float, *frames: int) -> list[MotRow]:
    return [box(frame, number, left) for frame in frames]


TWO_PEOPLE = stay(1, NEAR, 1, 2, 3, 4) + stay(2, FAR, 1, 2, 3, 4)


def test_scores_of_a_small_example() -> None:
    # Track 10 and then 11 follow the first person, 12 the other; 13 is a false positive.
    tracks = stay(10, NEAR, 1, 2) + stay(11, NEAR, 3, 4) + stay(12, FAR, 1, 2, 3, 4) + stay(13, 250.0, 1)
    scores = evaluate(TWO_PEOPLE, tracks)
    assert (scores.switches, scores.misses, scores.false_positives) == (1, 0, 1)
    assert (scores.fragments, scores.objects, scores.tracks) == (0, 2, 4)
    assert scores.mota == pytest.approx(1 - 2 / 8)
    assert (scores.recall, scores.precision) == pytest.approx((1.0, 8 / 9))
    assert scores.idf1 == pytest.approx(2 * 6 / (8 + 9))  # six boxes of nine stay right
    assert scores.deta == pytest.approx(8 / 9)
    assert scores.assa == pytest.approx((4 * 2 / 4 + 4 * 1) / 8)  # half of the first person, all of the other
    assert scores.hota == pytest.approx(sqrt(scores.deta * scores.assa))


def test_perfect_tracks_are_perfect() -> None:
    scores = evaluate(TWO_PEOPLE, [replace(row, id=row.id + 70) for row in TWO_PEOPLE])
    assert scores == Scores(1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 2, 2)


def test_no_tracks_are_all_misses() -> None:
    scores = evaluate(TWO_PEOPLE, [])
    assert (scores.hota, scores.mota, scores.idf1, scores.misses, scores.tracks) == (0, 0, 0, 8, 0)


def test_tracks_without_truth_are_all_false_positives() -> None:
    scores = evaluate([], TWO_PEOPLE)
    assert (scores.hota, scores.idf1, scores.false_positives, scores.objects) == (0, 0, 8, 0)


def test_ignored_people_count_neither_as_misses_nor_as_false_positives() -> None:
    passer_by = [box(frame, 9, 250.0, confidence=0.0) for frame in (1, 2, 3, 4)]
    tracks = [replace(row, confidence=1.0) for row in passer_by]
    assert evaluate(TWO_PEOPLE + passer_by, TWO_PEOPLE) == evaluate(TWO_PEOPLE, TWO_PEOPLE)
    assert evaluate(TWO_PEOPLE + passer_by, TWO_PEOPLE + tracks) == evaluate(TWO_PEOPLE, TWO_PEOPLE)


def test_a_track_near_an_ignored_person_still_matches_a_counted_one() -> None:
    beside = [box(frame, 9, 10.0, confidence=0.0) for frame in (1, 2, 3, 4)]
    assert evaluate(TWO_PEOPLE + beside, TWO_PEOPLE).precision == 1.0


@pytest.mark.parametrize(("shift", "found"), [(13.3, 1.0), (13.4, 0.0)])
def test_an_iou_of_one_half_matches(shift: float, found: float) -> None:
    # Boxes of 40 pixels moved by a third of that share 26.7 of 53.3.
    scores = evaluate(stay(1, NEAR, 1, 2), stay(5, shift, 1, 2))
    assert scores.recall == found
    assert evaluate(stay(1, NEAR, 1, 2), stay(5, shift, 1, 2), 0.3).recall == 1.0


def test_a_match_is_kept_although_another_overlaps_more() -> None:
    truth = stay(1, NEAR, 1, 2, 3)
    tracks = [*stay(10, 8.0, 1, 2, 3), *stay(11, 2.0, 2, 3)]
    assert evaluate(truth, tracks).switches == 0


def test_a_lost_person_is_matched_again_by_overlap() -> None:
    # Track 10 loses person 1 for a frame, and then overlaps person 2 more than 1: it is 2's, who had 11.
    truth = stay(1, 0.0, 1, 2, 3) + stay(2, 14.0, 1, 2, 3)
    tracks = stay(10, 0.0, 1) + stay(11, 14.0, 1, 2) + [box(3, 10, 11.0)]
    scores = evaluate(truth, tracks)
    assert (scores.switches, scores.misses) == (1, 2)


def test_an_id_twice_in_a_frame_is_refused() -> None:
    with pytest.raises(ValueError, match="tracks: frame 2 has id 5 twice"):
        evaluate(TWO_PEOPLE, stay(5, NEAR, 1, 2) + stay(5, FAR, 2))


def test_detections_are_refused_as_tracks() -> None:
    with pytest.raises(ValueError, match="detections, not tracks"):
        evaluate(TWO_PEOPLE, [replace(row, id=-1) for row in TWO_PEOPLE])


def test_different_ids_in_another_camera_lower_only_the_joint_scores() -> None:
    truth = stay(1, NEAR, 1, 2, 3, 4)
    cameras = {
        "c0": TruthAndTracks(truth, stay(10, NEAR, 1, 2, 3, 4)),
        "c1": TruthAndTracks(truth, stay(20, NEAR, 1, 2, 3, 4)),
    }
    scores = evaluate_cameras(cameras)
    assert [camera_scores.idf1 for camera_scores in scores.cameras.values()] == [1.0, 1.0]
    assert scores.joint.idf1 == 0.5
    assert (scores.joint.objects, scores.joint.tracks, scores.joint.switches) == (1, 2, 1)


def test_the_same_ids_in_every_camera_give_perfect_joint_scores() -> None:
    cameras = {name: TruthAndTracks(TWO_PEOPLE, TWO_PEOPLE) for name in ("c0", "c1", "c2")}
    assert evaluate_cameras(cameras).joint == Scores(1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 2, 2)


def test_shares_are_averaged_over_cameras_and_counts_added_up() -> None:
    cameras = {"c0": TruthAndTracks(TWO_PEOPLE, TWO_PEOPLE), "c1": TruthAndTracks(TWO_PEOPLE, [])}
    mean = evaluate_cameras(cameras).mean
    assert (mean.idf1, mean.recall, mean.misses, mean.objects) == (0.5, 0.5, 8, 4)


def test_a_camera_with_an_id_twice_is_named() -> None:
    with pytest.raises(ValueError, match=r"^c1: tracks: frame 1 has id 5 twice"):
        evaluate_cameras({"c1": TruthAndTracks(TWO_PEOPLE, stay(5, NEAR, 1) * 2)})


def test_oracle_association_has_no_switches_and_no_false_positives() -> None:
    detections = [replace(row, id=-1) for row in TWO_PEOPLE[:-1] + stay(0, 250.0, 1, 2)]
    scores = evaluate(TWO_PEOPLE, oracle_association(detections, TWO_PEOPLE))
    assert (scores.switches, scores.false_positives, scores.misses) == (0, 0, 1)


def test_oracle_association_of_public_detections(shared_data: Path) -> None:
    folder = shared_data / "mot15" / "TUD-Campus"
    truth = read_rows(folder / "gt.txt")
    scores = evaluate(truth, oracle_association(read_rows(folder / "det.txt"), truth))
    shares = [round(100 * share, 1) for share in (scores.hota, scores.mota, scores.idf1)]
    assert (shares, scores.switches) == ([56.4, 73.5, 84.8], 0)
