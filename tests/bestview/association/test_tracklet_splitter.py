"""Tracks are split where people may have been confused, and nowhere else; crowds give no appearance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import AppearanceHistogram, IdentitySettings, TrackKey, TrackUpdate
from bestview.association.sightings import FootPointError, align_tracks
from bestview.association.tracklet_splitter import TrackletSplitter

FEET = FootPointError(0.05, 0.15)
LEFT, RIGHT, ONTO_LEFT = (0.0, 0.0, 10.0, 20.0), (100.0, 0.0, 110.0, 20.0), (2.0, 0.0, 12.0, 20.0)


def track(
    local: int, first: int, boxes: Sequence[tuple[float, ...] | None], *histograms: AppearanceHistogram
) -> TrackUpdate:
    rows = np.array([box or (np.nan,) * 4 for box in boxes])
    return TrackUpdate("c0", local, first, rows, histograms)


def histogram_at(frame: int) -> AppearanceHistogram:
    return AppearanceHistogram(frame, frame, np.array([1.0, 3.0]))


def split_tracks(*updates: Sequence[TrackUpdate]) -> TrackletSplitter:
    tracklets = TrackletSplitter(IdentitySettings().resolve(25.0))
    for tracks in updates:
        rows, _ = tracklets.update(
            align_tracks(tracks, {"c0": None}, FEET), {track.key: track.appearance for track in tracks}
        )
        assert rows.max(initial=-1) < len(tracklets.active)
    return tracklets


def track_with_histograms(local: int, first: int, boxes: Sequence[tuple[float, ...] | None]) -> TrackUpdate:
    """Return a track whose every sighting has an appearance histogram."""
    return track(local, first, boxes, *(histogram_at(first + i) for i, box in enumerate(boxes) if box))


def spans(tracklets: TrackletSplitter, local: int) -> list[tuple[int, int]]:
    tracklets_of_track = [
        tracklet for tracklet in tracklets.active if tracklet.key.track == TrackKey("c0", local)
    ]
    return [(tracklet.key.first_frame, tracklet.end.frame) for tracklet in tracklets_of_track]


def test_a_gap_does_not_split_whom_several_cameras_track_together() -> None:
    boxes = [LEFT] * 10 + [None] * 25 + [LEFT] * 10
    alone = track_with_histograms(1, 0, boxes)
    seen = np.array([box is not None for box in boxes])
    together = replace(alone, detected={"west": seen, "south": np.zeros(45, dtype=np.bool_)})
    assert spans(split_tracks([alone]), 1) == [(0, 9), (35, 44)]
    joint = split_tracks([together])
    assert spans(joint, 1) == [(0, 44)]
    assert joint.active[0].detections == {"west": 20}


def test_a_track_that_leaves_a_crowd_starts_a_new_tracklet() -> None:
    met = [RIGHT] * 5 + [ONTO_LEFT] * 3 + [RIGHT] * 4
    tracklets = split_tracks([track(1, 0, [LEFT] * 12, histogram_at(0)), track(2, 0, met, histogram_at(0))])
    assert spans(tracklets, 1) == spans(tracklets, 2) == [(0, 7), (8, 11)]
    assert [tracklet.crowd_frames_before for tracklet in tracklets.active] == [0, 3, 0, 3]
    assert [tracklet.predecessor for tracklet in tracklets.active] == [
        None,
        tracklets.active[0],
        None,
        tracklets.active[2],
    ]


def test_short_overlaps_and_short_gaps_start_no_tracklet() -> None:
    met = [RIGHT] * 5 + [ONTO_LEFT] * 2 + [RIGHT] * 3 + [None] * 9 + [RIGHT] * 3
    assert spans(split_tracks([track(1, 0, [LEFT] * 22), track(2, 0, met, histogram_at(0))]), 2) == [(0, 21)]
    away = [RIGHT] * 5 + [None] * 11 + [RIGHT] * 3
    assert spans(split_tracks([track(2, 0, away, histogram_at(0))]), 2) == [(0, 4), (16, 18)]


def test_without_appearance_the_track_is_not_split() -> None:
    met = [RIGHT] * 5 + [ONTO_LEFT] * 3 + [RIGHT] * 4 + [None] * 20 + [RIGHT] * 3
    assert spans(split_tracks([track(1, 0, [LEFT] * 12), track(2, 0, met)]), 2) == [(0, 34)]


def test_appearance_histograms_in_a_crowd_do_not_count() -> None:
    coat = np.array([1.0, 3.0])
    met = [RIGHT] * 4 + [ONTO_LEFT] * 2
    crowded = AppearanceHistogram(3, 4, coat)
    alone = AppearanceHistogram(0, 2, coat)
    tracklets = split_tracks([track(1, 0, [LEFT] * 6), track(2, 0, met, alone, crowded)])
    [histogram] = [
        tracklet.appearance.by_camera["c0"] for tracklet in tracklets.active if tracklet.key.local_id == 2
    ]
    assert histogram.frame_count == 3
    np.testing.assert_allclose(histogram.mean, [0.25, 0.75])


def test_of_too_many_tracklets_the_longest_unseen_settle_first_but_not_before_publication() -> None:
    few = IdentitySettings(
        maximum_open_tracklets=2, settle_after_s=4.0, publish_after_s=0.2, clustering_interval_s=0.4
    )
    tracks = [track(n, 0, [(50.0 * n, 0.0, 50.0 * n + 10, 20.0)] * (10 * n)) for n in range(1, 6)]
    tracklets = TrackletSplitter(few.resolve(25.0))
    tracklets.update(align_tracks(tracks, {"c0": None}, FEET), {})
    assert [tracklet.end.frame for tracklet in tracklets.active] == [9, 19, 29, 39, 49]
    assert tracklets.settleable_rows(49) == [0, 1], "the third was published just now"
    assert tracklets.settleable_rows(60) == [0, 1, 2], "two remain"
    assert tracklets.settleable_rows(119) == [0, 1, 2]
    assert tracklets.settleable_rows(130) == [0, 1, 2]
    assert tracklets.settleable_rows(139) == [0, 1, 2, 3]


def test_a_tracklet_settled_without_an_id_is_followed_by_a_new_one() -> None:
    tracklets = split_tracks([track(1, 0, [LEFT] * 5)])
    tracklets.settle(list(tracklets.active), 200)
    again = [track(1, 201, [LEFT] * 5)]
    rows, settled = tracklets.update(align_tracks(again, {"c0": None}, FEET), {})
    assert rows.tolist() == [[0] * 5]
    assert not settled.any()
    assert spans(tracklets, 1) == [(201, 205)]


def test_a_tracklet_that_is_settled_while_it_continues_is_not_split() -> None:
    tracklets = split_tracks([track(1, 0, [LEFT] * 5)])
    tracklets.active[0].published_frames[7] = 5
    tracklets.settle(list(tracklets.active), 5)
    rows, settled = tracklets.update(align_tracks([track(1, 5, [LEFT] * 5)], {"c0": None}, FEET), {})
    assert (rows.tolist(), settled.tolist()) == ([[-1] * 5], [[7] * 5])
    assert not tracklets.active


@settings(deadline=None, max_examples=60)
@given(st.data())
def test_tracklets_do_not_depend_on_how_frames_are_grouped_into_updates(data: st.DataObject) -> None:
    frames = 40
    places = st.sampled_from([LEFT, RIGHT, ONTO_LEFT, None])
    runs = st.lists(st.tuples(places, st.integers(1, 14)), min_size=1, max_size=8)
    boxes = {
        local: [box for box, count in data.draw(runs) for _ in range(count)][:frames] for local in (1, 2)
    }
    cuts = sorted(data.draw(st.sets(st.integers(1, frames - 1), max_size=5)))
    updates = [
        [track_with_histograms(local, a, rows[a:b]) for local, rows in boxes.items() if any(rows[a:b])]
        for a, b in zip([0, *cuts], [*cuts, frames], strict=True)
    ]
    whole = split_tracks(
        [track_with_histograms(local, 0, rows) for local, rows in boxes.items() if any(rows)]
    )
    parts = split_tracks(*updates)
    for local in (1, 2):
        assert spans(parts, local) == spans(whole, local)
        assert sum(
            sum(tracklet.detections.values()) for tracklet in whole.active if tracklet.key.local_id == local
        ) == sum(map(bool, boxes[local]))
