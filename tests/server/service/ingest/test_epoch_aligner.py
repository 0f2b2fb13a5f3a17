"""Epochs are aligned in order, complete if possible, and without waiting for disconnected cameras."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from server.messaging.epochs import end_of_epoch
from server.messaging.messages import CameraTracks
from server.service.ingest.epoch_aligner import Epoch, EpochAligner

STRIDE, GRACE = 5, 12
CAMERAS = ("c0", "c1", "c2")


def window(camera: str, epoch: int, *, boot: int = 1, ended: bool = False) -> CameraTracks:
    last = (epoch + 1) * STRIDE - 1
    return CameraTracks(
        camera=camera,
        boot=boot,
        size=(64, 48),
        epoch=epoch,
        first=last,
        last=last,
        final_to=last,
        ended=ended,
        shed=[],
        tracks=[],
        solve=None,
    )


def connected_aligner(*cameras: str) -> EpochAligner:
    aligner = EpochAligner(CAMERAS, STRIDE, GRACE)
    for camera in cameras:
        aligner.camera_connected(camera)
        aligner.frame_received(camera, 1, 0)
    return aligner


def summary(epochs: list[Epoch]) -> list[tuple[int, tuple[str, ...], tuple[str, ...]]]:
    return [(epoch.number, tuple(epoch.tracks), epoch.late) for epoch in epochs]


def test_an_epoch_waits_for_every_connected_camera() -> None:
    aligner = connected_aligner("c0", "c1")
    aligner.add_tracks(window("c0", 0))
    assert aligner.take_ready(now=5) == []
    aligner.add_tracks(window("c1", 0))
    assert summary(aligner.take_ready(now=5)) == [(0, ("c0", "c1"), ())]


@given(st.permutations([(camera, epoch) for camera in CAMERAS for epoch in range(4)]))
def test_epochs_do_not_depend_on_the_order_of_the_cameras_messages(
    order: list[tuple[str, int]],
) -> None:
    aligner = connected_aligner(*CAMERAS)
    counts = dict.fromkeys(CAMERAS, 0)
    epochs = []
    for camera, _ in order:  # a camera's own messages stay in order, as on the bus
        aligner.add_tracks(window(camera, counts[camera]))
        counts[camera] += 1
        epochs += aligner.take_ready(now=0)
    assert summary(epochs) == [(number, CAMERAS, ()) for number in range(4)]


def test_a_late_camera_is_not_waited_for_until_it_is_in_time_again() -> None:
    aligner = connected_aligner("c0", "c1")
    aligner.add_tracks(window("c0", 0))
    assert aligner.take_ready(now=4) == []
    assert aligner.take_ready(now=4 + GRACE) == []
    assert summary(aligner.take_ready(now=5 + GRACE)) == [(0, ("c0",), ("c1",))]
    aligner.add_tracks(window("c0", 1))
    assert summary(aligner.take_ready(now=10)) == [(1, ("c0",), ())], "the late camera is not waited for"
    aligner.add_tracks(window("c1", 0))
    assert aligner.late_messages["c1"] == 1
    aligner.add_tracks(window("c1", 2))
    assert aligner.take_ready(now=15) == [], "in time again, so c0 is waited for"
    aligner.add_tracks(window("c0", 2))
    assert summary(aligner.take_ready(now=15)) == [(2, ("c0", "c1"), ())]


def test_a_disconnected_camera_is_not_waited_for() -> None:
    aligner = connected_aligner("c0", "c1")
    aligner.add_tracks(window("c0", 0))
    aligner.camera_disconnected("c1")
    assert summary(aligner.take_ready(now=5)) == [(0, ("c0",), ())]


def test_a_reconnected_camera_is_expected_from_its_first_frame_on() -> None:
    aligner = connected_aligner("c0", "c1")
    aligner.camera_disconnected("c1")
    aligner.camera_connected("c1")
    aligner.frame_received("c1", 2, 7)
    aligner.add_tracks(window("c0", 0))
    assert summary(aligner.take_ready(now=5)) == [(0, ("c0",), ())]
    aligner.add_tracks(window("c0", 1))
    assert aligner.take_ready(now=10) == [], "frame 7 is in epoch 1"
    aligner.add_tracks(window("c1", 1, boot=2))
    assert summary(aligner.take_ready(now=10)) == [(1, ("c0", "c1"), ())]


def test_a_camera_whose_recording_has_ended_is_not_waited_for() -> None:
    aligner = connected_aligner("c0", "c1")
    aligner.camera_disconnected("c2")
    for camera in ("c0", "c1"):
        aligner.add_tracks(window(camera, 0, ended=camera == "c0"))
    assert summary(aligner.take_ready(now=5)) == [(0, ("c0", "c1"), ())]
    assert not aligner.all_ended_and_decided
    aligner.add_tracks(window("c1", 1))
    assert summary(aligner.take_ready(now=10)) == [(1, ("c1",), ())]


def test_epochs_continue_without_any_camera() -> None:
    aligner = connected_aligner("c0")
    aligner.camera_disconnected("c0")
    assert summary(aligner.take_ready(now=9 + GRACE + 1)) == [(0, (), ()), (1, (), ())]


def test_a_camera_whose_window_was_lost_is_not_waited_for_and_reported_as_late() -> None:
    aligner = connected_aligner("c0", "c1")
    aligner.add_tracks(window("c0", 1))
    aligner.add_tracks(window("c1", 0))
    aligner.add_tracks(window("c1", 1))
    assert summary(aligner.take_ready(now=0)) == [(0, ("c1",), ("c0",)), (1, ("c0", "c1"), ())]


FAR = 300


def take_epochs(aligner: EpochAligner, now: int, count: int) -> list[Epoch]:
    """Take out the next epochs, at most ``count``."""
    return [epoch for _ in range(count) if (epoch := aligner.take_next_ready(now)) is not None]


def test_long_past_epochs_without_windows_are_skipped_at_once() -> None:
    aligner = EpochAligner(CAMERAS, STRIDE, GRACE, max_distance=FAR)
    for camera in ("c0", "c1"):
        aligner.frame_received(camera, 1, 0)
        aligner.add_tracks(window(camera, 0))
    assert summary(aligner.take_ready(now=4)) == [(0, ("c0", "c1"), ())]
    aligner.add_tracks(window("c0", 2))
    aligner.add_tracks(window("c1", 1_000_000))
    aligner.add_tracks(window("c0", 1_000_001, ended=True))
    (leap,) = take_epochs(aligner, 5_000_020, 2)
    (after,) = take_epochs(aligner, 5_000_021 + GRACE, 1)
    assert summary([leap, after]) == [(1_000_000, ("c1",), ("c0",)), (1_000_001, ("c0",), ("c1",))]
    assert (leap.skipped, after.skipped) == (999_999, 0)
    assert aligner.late_messages == {"c0": 1, "c1": 0, "c2": 0}


def test_without_cameras_epochs_are_skipped_to_the_present() -> None:
    aligner = EpochAligner(CAMERAS, STRIDE, GRACE, max_distance=FAR)
    aligner.frame_received("c0", 1, 0)
    assert aligner.take_ready(now=0) == []
    aligner.camera_disconnected("c0")
    assert aligner.take_ready(now=5_000_000) == []
    (epoch,) = aligner.take_ready(now=5_000_004 + GRACE + 1)
    assert (epoch.number, epoch.skipped) == (1_000_000, 1_000_000)


def test_recent_epochs_and_those_with_windows_are_not_skipped() -> None:
    aligner = EpochAligner(CAMERAS, STRIDE, GRACE, max_distance=FAR)
    aligner.frame_received("c0", 1, 0)
    assert aligner.take_ready(now=0) == []
    not_skipped = (FAR - GRACE) // STRIDE
    assert [epoch.number for epoch in aligner.take_ready(now=FAR)] == list(range(not_skipped))
    aligner.add_tracks(window("c0", not_skipped))
    (reported,) = take_epochs(aligner, 1000 * FAR, 2)
    (leap,) = take_epochs(aligner, 1000 * FAR + STRIDE + GRACE, 1)
    assert (reported.number, reported.skipped) == (not_skipped, 0)
    assert leap.skipped


def test_windows_far_from_the_present_do_not_determine_the_first_epoch() -> None:
    aligner = EpochAligner(CAMERAS, STRIDE, GRACE, max_distance=FAR)
    for camera, epoch in (("c0", 3), ("c1", 1_000_000), ("c2", 9_000_000)):
        aligner.frame_received(camera, 1, epoch * STRIDE)
        aligner.add_tracks(window(camera, epoch))
    assert take_epochs(aligner, 5_000_004, 1) == [], "c0 may still be right"
    assert summary(take_epochs(aligner, 5_000_005 + GRACE, 1)) == [(1_000_000, ("c1",), ("c0",))]
    assert aligner.late_messages == {"c0": 1, "c1": 0, "c2": 1}


def test_no_epoch_of_recordings_is_skipped() -> None:
    aligner = connected_aligner("c0")
    aligner.add_tracks(window("c0", 1000))
    assert [epoch.number for epoch in take_epochs(aligner, 10**9, 1001)] == list(range(1001))


BEHIND = 50


def test_cameras_that_are_all_behind_are_waited_for() -> None:
    """On a busy machine all cameras are two seconds late."""
    aligner = EpochAligner(CAMERAS, STRIDE, GRACE, BEHIND)
    for camera in CAMERAS:
        aligner.camera_connected(camera)
        aligner.frame_received(camera, 1, 0)
    epochs = []
    for now in range(400):
        for place, camera in enumerate(CAMERAS):
            epoch, rest = divmod(now - BEHIND - 3 * place + 1, STRIDE)
            if rest == 0 and epoch > 0:
                aligner.add_tracks(window(camera, epoch - 1))
        epochs += aligner.take_ready(now)
    assert summary(epochs) == [(number, CAMERAS, ()) for number in range(len(epochs))]
    assert len(epochs) > 60


def test_cameras_are_waited_for_no_longer_than_the_backlog_limit() -> None:
    aligner = EpochAligner(CAMERAS, STRIDE, GRACE, BEHIND)
    aligner.camera_connected("c0")
    aligner.frame_received("c0", 1, 0)
    assert aligner.take_ready(now=4 + GRACE + BEHIND) == []
    assert summary(aligner.take_ready(now=5 + GRACE + BEHIND)) == [(0, (), ("c0",))]
    aligner.camera_disconnected("c0")
    assert aligner.take_ready(now=9 + GRACE) == []
    assert summary(aligner.take_ready(now=10 + GRACE)) == [(1, (), ())], "no camera is connected"


def test_the_grace_period_begins_with_the_first_window() -> None:
    aligner = EpochAligner(CAMERAS, STRIDE, GRACE, BEHIND)
    for camera in ("c0", "c1"):
        aligner.camera_connected(camera)
        aligner.frame_received(camera, 1, 0)
    aligner.add_tracks(window("c0", 0))
    assert aligner.take_ready(now=40) == []
    assert aligner.take_ready(now=40 + GRACE) == []
    assert summary(aligner.take_ready(now=41 + GRACE)) == [(0, ("c0",), ("c1",))]


def test_skipping_goes_to_the_newest_reported_epoch() -> None:
    aligner = EpochAligner(CAMERAS, STRIDE, GRACE)
    for camera in CAMERAS:
        aligner.camera_connected(camera)
    for epoch in (0, 1, 2, 3, 4, 90):  # the last one is far ahead of the pulses
        for camera in CAMERAS:
            aligner.add_tracks(window(camera, epoch))
    now = end_of_epoch(4, STRIDE)
    assert [epoch.number for epoch in [aligner.take_next_ready(now)] if epoch] == [0]
    assert aligner.backlog(now) == 3 * STRIDE
    assert aligner.skip_to(now) == 3
    found = aligner.take_next_ready(now)
    assert found is not None
    assert (found.number, found.skipped, set(found.tracks)) == (4, 3, set(CAMERAS))
    assert aligner.skip_to(now) == 0


def test_a_window_ahead_of_time_does_not_cut_other_cameras_off() -> None:
    aligner = EpochAligner(CAMERAS, STRIDE, GRACE, max_distance=FAR)
    for camera in ("c0", "c1"):
        aligner.frame_received(camera, 1, 0)
    for epoch in range(30):
        aligner.add_tracks(window("c0", epoch))
    late = STRIDE - 1 + GRACE + 1
    assert aligner.take_ready(now=0) == []
    epochs = aligner.take_ready(now=late)
    assert (epochs[0].number, epochs[0].late) == (0, ("c1",)), "c1 was waited for"
    aligner.add_tracks(window("c1", 8))
    taken_out = [epoch for now in range(late, 9 * STRIDE) for epoch in aligner.take_ready(now)]
    assert "c1" in next(epoch.tracks for epoch in taken_out if epoch.number == 8)
    assert aligner.late_messages["c1"] == 0
