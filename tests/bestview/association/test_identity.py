"""A person has one id in every camera and keeps it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import (
    AppearanceHistogram,
    IdentityRegistry,
    IdentitySettings,
    IdentityUpdate,
    Merge,
    Split,
    TrackKey,
    TrackUpdate,
)
from fakes.bestview.identity_scenes import (
    BLIND,
    CALIBRATED,
    OPEN_TRACKLET_LIMITS,
    STRIDE,
    VIEWS,
    StraightTrack,
    collect_updates,
    in_two_cameras,
    numbers,
    persons_by_track,
    registry,
    updates,
)


@OPEN_TRACKLET_LIMITS
def test_a_person_has_one_id_in_every_camera(maximum_open: int) -> None:
    stays = [
        StraightTrack("south", 4, 0, 999, (0, 0)),
        StraightTrack("west", 9, 0, 999, (0, 0)),
        StraightTrack("south", 5, 0, 999, (3, 1)),
        StraightTrack("west", 8, 0, 999, (3, 1)),
    ]
    last = persons_by_track(collect_updates(registry(maximum_open_tracklets=maximum_open), stays, 60))
    assert last["south", 4] == last["west", 9]
    assert last["south", 5] == last["west", 8]
    assert sorted(last.values()) == [1, 1, 2, 2]


def test_ids_are_published_only_once_confirmed_and_created_once() -> None:
    seen = collect_updates(
        registry(confirmation_s=1.0, clustering_interval_s=0.2), in_two_cameras(1, (0, 0)), 60
    )
    # Two cameras see 10 frames together in every update.
    assert [update.created for update in seen] == [(), (), (1,)] + [()] * 9
    assert [len(numbers(update)) for update in seen[:4]] == [0, 0, 2, 2]


@OPEN_TRACKLET_LIMITS
def test_simultaneous_tracks_of_a_camera_are_two_people_however_close(maximum_open: int) -> None:
    stays = [*in_two_cameras(1, (0, 0)), *in_two_cameras(2, (0.3, 0.3))]
    last = persons_by_track(collect_updates(registry(maximum_open_tracklets=maximum_open), stays, 100))
    assert last["south", 1] != last["south", 2]
    assert last["west", 1] != last["west", 2]
    assert last["south", 1] == last["west", 1]


@OPEN_TRACKLET_LIMITS
def test_people_keep_their_ids_when_a_camera_restarts(maximum_open: int) -> None:
    people = [(-2.0, -2.0), (2.0, -1.0), (0.0, 3.0)]
    stays = [StraightTrack("south", 1 + i, 0, 999, at) for i, at in enumerate(people)]
    stays += [StraightTrack("west", 1 + i, 0, 99, at) for i, at in enumerate(people)]
    stays += [StraightTrack("west", 101 + i, 150, 999, at) for i, at in enumerate(people)]
    seen = collect_updates(registry(maximum_open_tracklets=maximum_open), stays, 200)
    again = persons_by_track(seen[: (150 // STRIDE) + 5])  # five updates after it came back
    assert [again["west", 101 + i] for i in range(3)] == [again["south", 1 + i] for i in range(3)]
    assert max(max(update.person_ids.values(), default=0) for update in seen) == 3


def test_a_person_who_reappears_at_the_same_place_keeps_the_id() -> None:
    stays = [StraightTrack("south", 1, 0, 100, (0, 0)), StraightTrack("south", 2, 110, 999, (0, 0))]
    for homographies in (CALIBRATED, BLIND):
        seen = collect_updates(registry(homographies), stays, 200)
        assert numbers(seen[-1])["south", 2] == 1
        assert all(update.created in {(), (1,)} for update in seen)


def test_an_impossible_distance_means_another_person() -> None:
    stays = [StraightTrack("south", 1, 0, 100, (-4, 0)), StraightTrack("south", 2, 104, 999, (4, 0))]
    assert numbers(collect_updates(registry(), stays, 200)[-1]) == {("south", 1): 1, ("south", 2): 2}


@pytest.mark.parametrize("settings", [{}, {"comparable_s": 10.0}], ids=["clustered", "reidentified"])
def test_a_returning_person_with_the_same_appearance_gets_the_id_back(settings: dict[str, int]) -> None:
    stays = [StraightTrack("south", coat, 0, 150, (coat - 3.0, 0), coat=coat) for coat in (1, 3, 5)]
    stays += [
        StraightTrack("south", 10, 450, 999, (4, 2), coat=3),
        StraightTrack("south", 11, 450, 999, (-4, 2), coat=7),
    ]
    seen = collect_updates(registry(**settings), stays, 600)
    assert [update.departed for update in seen if update.departed] == [(1, 2, 3)]
    assert [update.returned for update in seen if update.returned] == [(2,)]
    assert numbers(seen[-1]) == {("south", 10): 2, ("south", 11): 4}


@OPEN_TRACKLET_LIMITS
def test_a_forgotten_person_is_not_recognized_whether_visible_or_gone(maximum_open: int) -> None:
    stays = [StraightTrack("south", coat, 0, 150, (coat - 3.0, 0), coat=coat) for coat in (1, 3)]
    stays += [StraightTrack(view, 5, 0, 999, (2, 2), coat=5) for view in ("south", "west")]
    stays += [StraightTrack("south", coat, 450, 999, (coat - 3.0, 3), coat=coat - 10) for coat in (11, 13)]
    identities = registry(maximum_open_tracklets=maximum_open)
    seen: list[IdentityUpdate] = []
    before: dict[tuple[str, int], int] = {}
    for update in updates(identities, stays, 600):
        seen.append(update)
        if len(seen) == 300 // STRIDE:
            before = persons_by_track(seen)
            identities.forget({before["south", 3], before["south", 5]})
    later = seen[300 // STRIDE :]
    end = persons_by_track(later)
    assert before["west", 5] == before["south", 5]
    assert end["west", 5] == end["south", 5]
    assert end["south", 11] == before["south", 1], "others are recognized"
    assert len({*before.values(), *end.values()}) == 5, "who was forgotten has a new number"
    assert not any(update.split or update.merged for update in later)
    forgotten = {before["south", 3], before["south", 5]}
    assert all(forgotten.isdisjoint(update.person_ids.values()) for update in later)


def test_similar_people_do_not_get_each_others_ids_back() -> None:
    stays = [StraightTrack("south", local, 0, 150, (local - 3.0, 0), coat=3) for local in (1, 2, 3)]
    stays += [StraightTrack("south", 10, 400, 999, (4, 2), coat=3)]
    assert numbers(collect_updates(registry(), stays, 600)[-1]) == {("south", 10): 4}
    assert numbers(collect_updates(registry(comparable_s=10.0), stays, 600)[-1]) == {("south", 10): 4}


@pytest.mark.parametrize(("fps", "people"), [(5.0, 1), (25.0, 2)])
def test_reappearance_reach_depends_on_time_not_on_frames(fps: float, people: int) -> None:
    here = StraightTrack("south", 1, 0, 30, (-4, 0), coat=3)
    there = StraightTrack("south", 2, 46, 999, (1.7, 0), coat=3)
    identities = IdentityRegistry(
        replace(IdentitySettings(), confirmation_s=0.2, clustering_interval_s=0.2), CALIBRATED, fps=fps
    )
    assert len({*persons_by_track(collect_updates(identities, [here, there], 200)).values()}) == people


def test_without_calibration_only_distinctive_appearance_links_cameras() -> None:
    def dressed(coats: Sequence[int]) -> dict[tuple[str, int], int]:
        stays = [
            StraightTrack(camera, 1 + i, 0, 999, (2.0 * i - 3, 2.0 * i - 3), coat=worn)
            for camera in ("south", "west")
            for i, worn in enumerate(coats)
        ]
        return numbers(collect_updates(registry(BLIND), stays, 600)[-1])

    differing = dressed([1, 3, 5, 7])
    assert all(differing["south", i] == differing["west", i] for i in (1, 2, 3, 4))
    alike = dressed([3, 3, 3, 3])
    assert len(dict.fromkeys(alike.values())) == 8


def test_later_evidence_corrects_an_id_and_reports_it() -> None:
    # Two tracks are too far apart to be one person at first, and at the same place later.
    apart = [StraightTrack("south", 1, 0, 99, (0, 0)), StraightTrack("west", 1, 0, 99, (0, 6))]
    joined = [StraightTrack("south", 1, 100, 999, (0, 0)), StraightTrack("west", 1, 100, 999, (0, 0))]
    seen = collect_updates(registry(), [*apart, *joined], 400)
    assert numbers(seen[15]) == {("south", 1): 1, ("west", 1): 2}
    assert [update.merged for update in seen if update.merged] == [(Merge(1, 2),)]
    assert numbers(seen[-1]) == {("south", 1): 1, ("west", 1): 1}


@OPEN_TRACKLET_LIMITS
@pytest.mark.parametrize("dressed", [True, False], ids=["appearance and ground", "ground alone"])
def test_a_track_that_switches_people_in_a_crowd_becomes_two_tracklets(
    maximum_open: int, *, dressed: bool
) -> None:
    # Two people meet and part in one camera, whose tracker swaps them; another camera tracks both correctly.
    def meeting(
        camera: str, local: int, place: float, speed: float, start: int = 0, end: int = 999
    ) -> StraightTrack:
        return StraightTrack(
            camera, local, start, end, (place, 0), (speed, 0), dressed * (1 + 2 * (place > 0))
        )

    stays = [
        StraightTrack("west", 1, 0, 999, (-3, 0), (0.03, 0), dressed * 1),
        StraightTrack("west", 2, 0, 999, (3, 0.8), (-0.03, 0), dressed * 3),
    ]
    stays += [meeting("south", 1, -3, 0.03, end=100), meeting("south", 2, 3, -0.03, end=100)]
    stays += [meeting("south", 2, -3, 0.03, start=101), meeting("south", 1, 3, -0.03, start=101)]
    seen = collect_updates(registry(maximum_open_tracklets=maximum_open), stays, 200)
    before, after = persons_by_track(seen[: 80 // STRIDE]), persons_by_track(seen)
    assert len({before["south", 1], before["south", 2]}) == 2
    assert after["south", 1] == before["south", 2]
    assert after["south", 2] == before["south", 1]
    assert not [update.merged for update in seen if update.merged]


def test_a_person_who_shared_an_id_gets_a_new_one_and_the_split_is_reported() -> None:
    # One camera tracks two people as one until they part; the others see only the one who stays.
    together = [StraightTrack(camera, 1, 0, 150, (0, 0)) for camera in VIEWS]
    apart = [StraightTrack(camera, 1, 151, 999, (4, 3) if camera == "west" else (0, 0)) for camera in VIEWS]
    updated = collect_updates(registry(), [*together, *apart], 500)
    assert numbers(updated[150 // STRIDE - 1]) == {("south", 1): 1, ("west", 1): 1, ("north", 1): 1}
    assert [split for update in updated for split in update.split] == [Split(1, 2, "west")]
    assert numbers(updated[-1]) == {("south", 1): 1, ("west", 1): 2, ("north", 1): 1}


def test_truncated_feet_have_no_ground_point() -> None:
    near = StraightTrack(
        "south", 1, 0, 999, (0, -7)
    )  # 3 m from the camera: the feet are far below the picture
    cut = 480.0
    other = StraightTrack(
        "west", 1, 0, 999, (0, -5)
    )  # stands where a foot at the edge of the south picture would

    def seen(height: float) -> IdentityUpdate:
        identities = registry()
        for last in range(STRIDE - 1, 200, STRIDE):
            south = near.track(last - STRIDE + 1, last)
            boxes = south.boxes.copy()
            boxes[:, 3] = np.minimum(boxes[:, 3], cut)
            south = replace(south, boxes=boxes, picture_height=height)
            update = identities.update([south, other.track(last - STRIDE + 1, last)], last)
        return update

    assert numbers(seen(np.inf)) == {("south", 1): 1, ("west", 1): 1}
    assert numbers(seen(cut)) == {("south", 1): 1, ("west", 1): 2}


@settings(deadline=None, max_examples=10)
@given(st.data())
def test_ids_do_not_depend_on_the_order_of_tracks(data: st.DataObject) -> None:
    spot = st.tuples(st.integers(-4, 4), st.integers(-4, 4))
    stays = []
    for camera in VIEWS:
        for local in range(1, data.draw(st.integers(1, 3)) + 1):
            begin = data.draw(st.integers(0, 60))
            end = begin + data.draw(st.integers(5, 80))
            stays.append(
                StraightTrack(camera, local, begin, end, data.draw(spot), coat=data.draw(st.integers(0, 4)))
            )
    shuffled = data.draw(st.permutations(stays))
    one, two = registry(), registry()
    for first, second in zip(updates(one, stays, 140), updates(two, shuffled, 140), strict=True):
        assert first == second
        for camera in VIEWS:
            visible = [n for (c, _), n in numbers(first).items() if c == camera]
            assert all(number >= 1 for number in visible)


@settings(deadline=None, max_examples=10)
@given(st.data())
def test_simultaneous_tracks_of_a_camera_never_share_an_id(data: st.DataObject) -> None:
    spot = st.tuples(st.integers(-3, 3), st.integers(-3, 3))
    stays = [
        StraightTrack(camera, local, 0, 200, data.draw(spot), coat=data.draw(st.integers(0, 3)))
        for camera in VIEWS
        for local in range(1, data.draw(st.integers(1, 4)) + 1)
    ]
    for update in updates(registry(), stays, 100):
        for camera in VIEWS:
            here = [number for (name, _), number in numbers(update).items() if name == camera]
            assert len(here) == len(dict.fromkeys(here))


@OPEN_TRACKLET_LIMITS
def test_a_person_settled_while_visible_does_not_depart(maximum_open: int) -> None:
    seen = collect_updates(
        registry(maximum_open_tracklets=maximum_open, departed_after_s=2.4, settle_after_s=4.0),
        in_two_cameras(1, (0, 0), end=400),
        600,
    )
    assert [update.departed for update in seen if update.departed] == [(1,)]
    gone = next(i for i, update in enumerate(seen) if update.departed)
    assert 400 + 60 < STRIDE * gone + STRIDE - 1 <= 400 + 60 + 2 * STRIDE
    assert [update.created for update in seen if update.created] == [(1,)]


def test_memory_does_not_grow_with_the_length_of_the_recording() -> None:
    identities = registry(
        forget_after_s=8.0,
        maximum_departed_people=5,
        comparable_s=4.0,
        settle_after_s=4.0,
        departed_after_s=2.0,
    )
    stays = [StraightTrack("south", i, 30 * i, 30 * i + 25, (4.0 * (-1) ** i, i % 5 - 2)) for i in range(100)]
    sizes = []
    for _ in updates(identities, stays, 3000):
        open_ = identities._splitter
        sizes.append(
            (len(identities._people), len(open_.active), len(open_._current), len(identities._affinity))
        )
    assert max(max(size) for size in sizes) <= 20
    assert sizes[-1][0] <= 10


@pytest.mark.parametrize(
    "zero_settings",
    [
        {name: 0}
        for name in (
            "confirmation_s",
            "comparable_s",
            "maximum_open_tracklets",
            "publish_after_s",
            "merge_after_s",
            "gap_s",
            "crowd_iou",
        )
    ]
    + [{"confirmation_s": 0.0, "comparable_s": 200.0, "merge_after_s": 20.0, "settle_after_s": 0.8}],
    ids=", ".join,
)
def test_minimal_settings_work_while_cameras_come_and_go(zero_settings: Mapping[str, int]) -> None:
    # Histograms of different sizes, empty and zero ones; noisy boxes; tracks that pause and restart.
    random = np.random.default_rng(1)
    identities = registry({"south": CALIBRATED["south"], "west": None}, **zero_settings)
    updates = []
    for last in range(STRIDE - 1, 1000, STRIDE):
        tracks = []
        for camera in ("south", "west"):
            for local in range(4):
                if last // (150 + 37 * local) % 3 == 2:
                    continue
                left = 100.0 * local + 0.1 * last * (local - 1.5)
                boxes = np.array([left, 100.0, left + 40.0, 220.0]) + random.normal(0, 4, (STRIDE, 4))
                histogram = random.random(random.choice([0, 8, 8, 16])) if local else np.zeros(8)
                sample = AppearanceHistogram(last - STRIDE + 1, last, histogram)
                run = 1 + local + 4 * (last // 400)
                tracks.append(TrackUpdate(camera, run, last - STRIDE + 1, boxes, (sample,)))
        updates.append(identities.update(tracks, last))
        assert all(number >= 1 for number in numbers(updates[-1]).values())
    assert persons_by_track(updates)


def test_invalid_arguments_are_refused_in_one_line() -> None:
    track = StraightTrack("south", 1, 0, 99, (0, 0)).track(0, 14)

    def refused(match: str, *tracks: TrackUpdate, last: int = 14) -> None:
        with pytest.raises(ValueError, match=match) as refusal:
            registry().update(tracks, last)
        assert "\n" not in str(refusal.value)

    refused("camera is unknown", replace(track, camera="cellar"))
    refused("shape", replace(track, boxes=np.zeros((15, 3))))
    refused("frames", replace(track, detected={"west": np.ones(3, dtype=np.bool_)}))
    refused("histogram", replace(track, appearance=(AppearanceHistogram(0, 3, np.zeros((2, 2))),)))
    refused("of frames 3 to 20", replace(track, appearance=(AppearanceHistogram(3, 20, np.zeros(2)),)))
    refused("occurs twice", track, track)
    with pytest.raises(ValueError, match="of camera south is not invertible"):
        IdentityRegistry(IdentitySettings(), {"south": np.ones((3, 3))})
    identities = registry()
    identities.update([track], 14)
    with pytest.raises(ValueError, match="comes after"):
        identities.update([track], 14)
    with pytest.raises(ValueError, match="memory"):
        IdentitySettings(cross_camera_memory_s=0.0)
    with pytest.raises(ValueError, match="gate"):
        IdentitySettings(gate_distance=0.0)


def test_no_tracks_are_no_people() -> None:
    update = registry().update([], 4)
    assert update == IdentityUpdate({}, (), (), (), (), ())
    assert TrackKey("a", 2) < TrackKey("b", 1)


def test_a_person_is_reidentified_by_appearance_in_a_camera_without_common_ground() -> None:
    # Also on a common ground, since the two cameras never see a person at the same time.
    for homographies in (CALIBRATED, BLIND):
        stays = [StraightTrack("south", coat, 0, 100, (coat - 3.0, 0), coat=coat) for coat in (1, 3, 5)]
        stays += [
            StraightTrack("west", 9 - coat, 300, 999, (-2, coat - 3.0), coat=coat) for coat in (1, 3, 5)
        ]
        ids = persons_by_track(collect_updates(registry(homographies), stays, 400))
        assert [ids["west", 9 - coat] for coat in (1, 3, 5)] == [ids["south", coat] for coat in (1, 3, 5)]


def test_travel_times_separate_people_who_look_alike() -> None:
    def stays() -> Iterator[StraightTrack]:
        # People with different coats go from south to west in 200 frames, one after the other ...
        for i in range(8):
            begin = 350 * i
            yield StraightTrack("south", 1 + i, begin, begin + 60, (0, 0), coat=1 + i % 6)
            yield StraightTrack("west", 1 + i, begin + 260, begin + 320, (0, 0), coat=1 + i % 6)
        # ... then two with similar coats leave at different times, and after the usual travel time of the
        # second a person arrives whose coat is as similar to either.
        yield StraightTrack("south", 21, 2800, 2860, (0, 0), coat=6.7)
        yield StraightTrack("south", 22, 2800, 3300, (3, 0), coat=7.3)
        yield StraightTrack("west", 21, 3500, 3600, (0, 0), coat=6.4)

    def ids_with(**changes: float) -> dict[tuple[str, int], int]:
        return persons_by_track(
            collect_updates(registry(BLIND, comparable_s=0.8, **changes), list(stays()), 3600)
        )

    times, alone = ids_with(), ids_with(maximum_travel_evidence=0.0)
    assert times["south", 21] != times["south", 22]
    assert times["west", 21] == times["south", 22]
    assert alone["west", 21] not in {alone["south", 21], alone["south", 22]}, "appearance alone is ambiguous"
