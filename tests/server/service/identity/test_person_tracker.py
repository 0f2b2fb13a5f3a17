"""Person numbers of tracks, over restarts of cameras, merges, and forgetting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import IdentitySettings, IdentityUpdate, Merge, Split, TrackKey, TrackletKey, TrackUpdate
from fakes.service.scripted_cameras import (
    CAMERAS,
    HEIGHT,
    LARGE,
    SMALL,
    STRIDE,
    WIDTH,
    camera_tracks,
    epoch_of,
)
from fakes.service.scripted_identities import ScriptedRegistry, boxes, identity_update, people
from server.service.identity.local_numbers import LocalNumbers
from server.service.identity.person_tracker import PersonTracker
from server.service.ingest.window_history import WindowHistory


class RecordingRegistry:
    """An identity registry that records its input."""

    def __init__(self, track_updates: list[TrackUpdate]) -> None:
        self._track_updates = track_updates
        self.pictures: dict[str, tuple[int, int]] = {}

    def update(
        self, tracks: list[TrackUpdate], last_frame: int, pictures: Mapping[str, tuple[int, int]]
    ) -> IdentityUpdate:
        del last_frame
        self._track_updates += tracks
        self.pictures.update(pictures)
        return identity_update({})


def scripted_people(*updates: IdentityUpdate) -> PersonTracker:
    tracker = people()
    tracker._registry = ScriptedRegistry(*updates)  # type: ignore[assignment]
    return tracker


@settings(deadline=None, max_examples=100)
@given(st.lists(st.tuples(st.integers(0, 12), st.integers(-1, 6)), max_size=6), st.integers(0, 15))
def test_the_newest_window_of_a_frame_counts(windows: list[tuple[int, int]], old: int) -> None:
    history, expected = WindowHistory[int](), dict[int, int]()
    for number, (first, more) in enumerate(windows):
        history.put(number, first, first + more)
        expected |= dict.fromkeys(range(first, first + more + 1), number)
    history.forget_before(old)
    newest = [
        (pulse, span.window) for span in history.over(2, 14) for pulse in range(span.first, span.last + 1)
    ]
    assert newest == sorted((pulse, span) for pulse, span in expected.items() if max(old, 2) <= pulse <= 14)


def test_a_restarted_cameras_first_track_is_not_its_former_first_track() -> None:
    numbers = LocalNumbers()
    assert numbers.of(camera_tracks("c0", 0, {1: SMALL, 2: SMALL})) == (TrackKey("c0", 1), TrackKey("c0", 2))
    assert numbers.of(camera_tracks("c0", 1, {1: SMALL}, boot=2)) == (TrackKey("c0", 3),)
    assert numbers.of(camera_tracks("c1", 1, {1: SMALL})) == (TrackKey("c1", 1),)
    assert numbers.known("c0", 1, 1) == TrackKey("c0", 1)
    assert numbers.known("c0", 2, 1) == TrackKey("c0", 3)


def test_a_forgotten_track_that_reappears_has_a_new_number() -> None:
    numbers = LocalNumbers()
    numbers.of(camera_tracks("c0", 0, {1: SMALL}))
    numbers.forget(TrackKey("c0", 1))
    assert numbers.known("c0", 1, 1) is None
    assert numbers.of(camera_tracks("c0", 5, {1: SMALL})) == (TrackKey("c0", 2),)


def test_the_registry_receives_picture_sizes_and_boxes_in_the_cameras_own_pixels() -> None:
    tracker = people()
    track_updates: list[TrackUpdate] = []
    tracker._registry = registry = RecordingRegistry(track_updates)  # type: ignore[assignment]
    tracker.update(
        epoch_of(
            0, camera_tracks("c0", 0, {1: SMALL}, size=(WIDTH // 2, HEIGHT // 2)), camera_tracks("c1", 0, {})
        )
    )
    assert registry.pictures == {"c0": (WIDTH // 2, HEIGHT // 2), "c1": (WIDTH, HEIGHT)}, (
        "of cameras without tracks, too"
    )
    [track] = track_updates
    assert track.picture_height == HEIGHT // 2, "in the camera's own pixels, as its boxes"
    np.testing.assert_allclose(track.boxes, np.tile(np.array(SMALL) / 2, (STRIDE, 1)))


def test_a_camera_without_detection_is_no_evidence_of_absence() -> None:
    tracker = PersonTracker(IdentitySettings(), CAMERAS, dict.fromkeys(CAMERAS), (WIDTH, HEIGHT), lag=STRIDE)
    has_picture = []
    for epoch in range(8):
        tracker._registry = registry = RecordingRegistry([])  # type: ignore[assignment]
        without_detection = (
            range(epoch * STRIDE + (epoch == 6), (epoch + 1) * STRIDE) if 3 <= epoch < 7 else ()
        )
        tracker.update(
            epoch_of(
                epoch,
                camera_tracks("c0", epoch, {1: SMALL}),
                camera_tracks("c1", epoch, {}, without_detection=[*without_detection]),
            )
        )
        has_picture.append("c1" in registry.pictures)
    assert has_picture == [True, True, True, True, False, False, False, True], (
        "a stride later, when it is final"
    )


def test_a_camera_whose_picture_size_changes_has_boxes_in_the_new_size() -> None:
    tracker = people()
    for epoch, size in enumerate([(WIDTH, HEIGHT), (WIDTH // 2, HEIGHT // 2)]):
        track_updates: list[TrackUpdate] = []
        tracker._registry = RecordingRegistry(track_updates)  # type: ignore[assignment]
        tracker.update(epoch_of(epoch, camera_tracks("c0", epoch, {1: SMALL}, size=size, boot=1 + epoch)))
        [track] = track_updates
        np.testing.assert_allclose(track.boxes, np.tile(np.array(SMALL) * size[0] / WIDTH, (STRIDE, 1)))


def test_people_have_their_tracks_boxes() -> None:
    tracker = people()
    tracker.update(
        epoch_of(0, camera_tracks("c0", 0, {1: SMALL, 2: LARGE}), camera_tracks("c1", 0, {1: None}))
    )
    first, second = tracker.known
    assert boxes(tracker, "c0", 4) == {first: SMALL, second: LARGE}
    assert boxes(tracker, "c1", 4) == {}
    assert tracker.person_of("c0", 1, 2, 0) == second
    assert tracker.person_of("c0", 9, 2, 0) is None


def test_first_and_last_seen_are_the_frames_with_a_box() -> None:
    tracker = people()
    for epoch in range(3):
        tracker.update(epoch_of(epoch, camera_tracks("c0", epoch, {1: SMALL if epoch < 2 else None})))
    [number] = tracker.known
    assert (tracker.registry.first_seen[number], tracker.registry.last_seen[number]) == (0, 2 * STRIDE - 1)


def test_a_person_confirmed_late_exists_from_their_first_box_on() -> None:
    def since(*numbers: tuple[int, int]) -> IdentityUpdate:
        return replace(
            identity_update({}), person_ids={TrackletKey("c0", 1, first): number for first, number in numbers}
        )

    later = 3 * STRIDE
    tracker = scripted_people(
        identity_update({}),
        since((STRIDE, 0)),
        since((STRIDE, 1)),
        since((STRIDE, 1), (later, 0)),
        since((STRIDE, 1), (later, 2)),
    )
    for epoch in range(5):
        tracker.update(epoch_of(epoch, camera_tracks("c0", epoch, {1: None if epoch == 0 else SMALL})))
    assert tracker.registry.first_seen == {1: STRIDE, 2: later}
    assert tracker.registry.last_seen == {1: later - 1, 2: 5 * STRIDE - 1}
    numbers = tracker.numbers([TrackKey("c0", 1)], 0, 5 * STRIDE)[0].tolist()
    assert numbers == [-1] * STRIDE + [1] * (later - STRIDE) + [2] * (2 * STRIDE)


def test_undecided_frames_keep_their_numbers_after_the_registry_has_settled_them() -> None:
    def since(*parts: tuple[int, int]) -> IdentityUpdate:
        return replace(
            identity_update({}), person_ids={TrackletKey("c0", 1, first): number for first, number in parts}
        )

    second, third = 2 * STRIDE, 4 * STRIDE
    tracker = scripted_people(
        since((0, 1)),
        since((0, 1)),
        since((0, 1), (second, 2)),
        since((second, 2)),
        since((third, 3)),
        since((third, 3)),
        replace(since((third, 4)), merged=(Merge(kept=4, lost=2),)),
    )

    def current_numbers() -> list[int]:
        return [next(iter(boxes(tracker, "c0", first)), -1) for first in (0, second, third)]

    for epoch in range(5):
        tracker.update(epoch_of(epoch, camera_tracks("c0", epoch, {1: SMALL})))
    assert current_numbers() == [1, 2, 3]
    tracker.forget_before(second)
    tracker.update(epoch_of(5, camera_tracks("c0", 5, {1: SMALL})))
    assert current_numbers() == [-1, 2, 3]
    assert len(tracker._parts[TrackKey("c0", 1)]) == 2, "parts before the needed frames are dropped"
    tracker.update(epoch_of(6, camera_tracks("c0", 6, {1: SMALL})))
    assert current_numbers() == [-1, 4, 4], "merges apply to settled frames, too"


def test_a_restarted_cameras_tracks_do_not_inherit_earlier_boxes() -> None:
    tracker = people()
    tracker.update(epoch_of(0, camera_tracks("c0", 0, {1: SMALL})))
    tracker.update(epoch_of(1, camera_tracks("c0", 1, {1: LARGE}, boot=2)))
    [before], [after] = boxes(tracker, "c0", 0), boxes(tracker, "c0", STRIDE)
    assert tracker.person_of("c0", 1, 1, 0) == before
    assert tracker.person_of("c0", 2, 1, STRIDE) == after


def test_only_the_newest_merged_numbers_are_remembered() -> None:
    """A person who stays all day has many short tracks merged into them."""
    tracker = people(maximum_departed_people=5)
    for lost in range(2, 40):
        tracker.merge(1, lost)
    assert tracker.registry.merged == dict.fromkeys(range(35, 40), 1)
    assert tracker.registry.aliases(1) == [*range(35, 40)]


def test_merged_numbers_resolve_through_chains() -> None:
    tracker = scripted_people(
        identity_update({("c0", 1): 1, ("c0", 2): 2, ("c1", 1): 3}),
        identity_update({("c0", 1): 1, ("c0", 2): 2, ("c1", 1): 2}, Merge(kept=2, lost=3)),
        identity_update({("c0", 1): 1, ("c0", 2): 1, ("c1", 1): 1}, Merge(kept=1, lost=2)),
    )
    for epoch in range(3):
        tracker.update(
            epoch_of(
                epoch, camera_tracks("c0", epoch, {1: SMALL, 2: None}), camera_tracks("c1", epoch, {1: LARGE})
            )
        )
    assert tracker.known == [1]
    assert tracker.registry.merged == {3: 1, 2: 1}
    assert boxes(tracker, "c1", 0) == {1: LARGE}, "in past frames, too"
    assert tracker.registry.aliases(1) == [2, 3]


def test_corrections_are_returned_once_and_in_order() -> None:
    merge, split = Merge(kept=1, lost=2), Split(published_id=1, corrected_id=4, camera="c0")
    tracker = scripted_people(
        identity_update({("c0", 1): 1}, merge),
        identity_update({("c0", 1): 4}, split),
        identity_update({("c0", 1): 4}),
    )
    for epoch in range(2):
        tracker.update(epoch_of(epoch, camera_tracks("c0", epoch, {1: SMALL})))
    assert tracker.take_corrections() == (merge, split)
    tracker.update(epoch_of(2, camera_tracks("c0", 2, {1: SMALL})))
    assert tracker.take_corrections() == ()


def test_a_track_that_moves_to_an_unconfirmed_person_has_no_number() -> None:
    tracker = scripted_people(identity_update({("c0", 1): 1}), identity_update({("c0", 1): 0}))
    tracker.update(epoch_of(0, camera_tracks("c0", 0, {1: SMALL})))
    tracker.update(epoch_of(1, camera_tracks("c0", 1, {1: SMALL})))
    assert boxes(tracker, "c0", STRIDE) == {}
    assert tracker.number("c0", 1, STRIDE) is None


def test_two_tracks_of_one_person_in_one_picture_are_one_box() -> None:
    tracker = scripted_people(identity_update({("c0", 1): 1, ("c0", 2): 1}))
    tracker.update(epoch_of(0, camera_tracks("c0", 0, {1: SMALL, 2: LARGE})))
    assert boxes(tracker, "c0", 0) == {1: SMALL}


def test_people_not_seen_for_long_are_forgotten_entirely() -> None:
    tracker = people(departed_after_s=STRIDE / 25, forget_after_s=3 * STRIDE / 25)
    tracker.update(epoch_of(0, camera_tracks("c0", 0, {1: SMALL})))
    [number] = tracker.known
    for epoch in range(1, 4):
        tracker.update(epoch_of(epoch, camera_tracks("c0", epoch, {})))
    assert tracker.known == [number]
    assert tracker.registry.departed == {number}
    tracker.update(epoch_of(9, camera_tracks("c0", 9, {})))
    assert tracker.known == []
    assert tracker.registry.departed == set()
    assert tracker.person_of("c0", 1, 1, 0) is None
    assert not tracker._parts
    assert not tracker._last_reported


@pytest.mark.parametrize("pulse", [-1, 0, 4, 1000])
def test_frames_without_windows_have_no_boxes(pulse: int) -> None:
    assert boxes(people(), "c0", pulse) == {}
