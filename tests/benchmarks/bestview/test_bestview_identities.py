"""Identity scores and tracklets of the best-view benchmark, on simple boxes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from benchmarks.bestview.identity_errors import MatchedBoxes, PairScores
from benchmarks.bestview.tracklet_cuts import own_tracklets
from server.config.loader import build_config
from server.messaging.messages import Box, CameraTracks, TrackMessage
from server.messaging.packed_arrays import pack_boxes
from tracking.motchallenge import MotRow

CROSSING = range(40, 50)
"""Frames in which two tracks are in one place."""


def rows(number: int, left: float, frames: Sequence[int]) -> list[MotRow]:
    return [MotRow(frame, number, left, 0.0, 10.0, 20.0) for frame in frames]


GT = {
    "c0": [*rows(7, 0.0, range(1, 11)), *rows(8, 50.0, range(1, 11))],
    "c1": [*rows(7, 30.0, range(1, 11)), *rows(8, 80.0, range(1, 11))],
}


def test_one_number_in_one_camera_and_another_in_the_other_is_not_whole_but_pure() -> None:
    tracks = {
        "c0": rows(1, 0.0, range(1, 11)),
        "c1": [*rows(1, 30.0, range(1, 6)), *rows(2, 30.0, range(6, 11))],
    }
    matched = MatchedBoxes.of(tracks, GT, 0.5)
    assert matched.across_cameras() == PairScores(recall=0.5, precision=1.0)
    # In c0 nobody changes; in c1 two boxes of five are followed by one of another number two frames later.
    assert matched.over_time(2) == PairScores(recall=(8 + 6) / 16, precision=1.0)


def test_two_people_of_one_number_are_whole_but_not_pure() -> None:
    tracks = {
        "c0": [*rows(1, 0.0, range(1, 6)), *rows(1, 50.0, range(6, 11))],
        "c1": rows(1, 30.0, range(1, 11)),
    }
    matched = MatchedBoxes.of(tracks, GT, 0.5)
    assert matched.across_cameras() == PairScores(recall=1.0, precision=0.5)
    assert matched.over_time(5) == PairScores(recall=1.0, precision=5 / 10)


def test_boxes_at_nobody_and_people_without_boxes_say_nothing() -> None:
    matched = MatchedBoxes.of({"c0": rows(1, 200.0, range(1, 11)), "c1": []}, GT, 0.5)
    for scores in (matched.across_cameras(), matched.over_time(1)):
        assert np.isnan([scores.recall, scores.precision]).all()


def test_of_two_boxes_at_one_person_one_counts() -> None:
    matched = MatchedBoxes.of({"c0": [*rows(1, 0.0, [1]), *rows(2, 1.0, [1])], "c1": []}, GT, 0.5)
    assert matched.number.tolist() == [1]


def message(boxes: Sequence[Sequence[Box | None]], frames: int) -> CameraTracks:
    tracks = [
        TrackMessage(id=number, boxes=pack_boxes(track_boxes), confidence=1.0)
        for number, track_boxes in enumerate(boxes, start=1)
    ]
    return CameraTracks(
        camera="c0",
        boot=0,
        size=(200, 100),
        epoch=frames // 5,
        first=0,
        last=frames - 1,
        final_to=frames - 1,
        ended=True,
        shed=[],
        tracks=tracks,
        solve=None,
    )


@pytest.mark.parametrize(("calibrated", "tracklets"), [(True, 4), (False, 2)])
def test_tracks_are_cut_where_two_were_in_one_place_if_there_is_a_ground_to_ask_by(
    calibrated: bool, tracklets: int
) -> None:
    frames = 90
    ground = np.diag([0.1, 0.1, 1.0]).tolist() if calibrated else None
    camera = {"id": "c0", "source": "scene:none"} | ({"ground": ground} if calibrated else {})
    site = {"name": "hall", "fps": 10.0, "width": 400, "height": 200}
    config = build_config({"site": site, "cameras": [camera]}, where="hall", folder=Path())
    standing: list[Box | None] = [(50.0, 20.0, 60.0, 40.0)] * frames
    crossing: list[Box | None] = [
        (51.0, 20.0, 61.0, 40.0) if frame in CROSSING else (150.0, 20.0, 160.0, 40.0)
        for frame in range(frames)
    ]
    found = own_tracklets(config, {"c0": [message([standing, crossing], frames)]})["c0"]
    assert len({row.id for row in found}) == tracklets
    assert len(found) == 2 * frames
    first = next(row for row in found if row.frame == 1 and row.left < 200)
    assert (first.left, first.width) == (50.0, 10.0), "in the site's picture, as the camera said it"
