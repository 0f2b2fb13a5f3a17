"""Joint tracking between ingest and identity: cameras' observations become tracks with one id in all."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from fakes.service.joint_floor import SIZE, STRIDE, VIEWS, joint_config, walk_past, walked_epochs
from fakes.tracking.walked_floor import FloorNoise
from server.messaging.observations import FrameObservations
from server.messaging.packed_arrays import (
    are_boxes,
    pack_boxes,
    pack_detections,
    unpack_boxes,
    unpack_detections,
    unpack_histograms,
)
from server.messaging.picture_motion import picture_motion
from server.service.ingest.epoch_aligner import Epoch
from server.service.joint_tracking.stage import JointStage
from tracking.boxes import iou
from tracking.detectors.background.motion import Motion

LAG = 4


def tracked(epochs: list[Epoch]) -> list[Epoch]:
    stage = JointStage(joint_config())
    return [stage.step(epoch) for epoch in epochs]


def test_people_have_the_same_number_and_their_boxes_in_every_camera() -> None:
    walks = walk_past()
    epochs = tracked(list(walked_epochs(walks, noise=FloorNoise(missed=0.1, deviation=0.005))))
    ids = set()
    for epoch in epochs[8:]:
        for name, message in epoch.tracks.items():
            assert len(message.tracks) == 2
            for track in message.tracks:
                for frame, box in enumerate(unpack_boxes([track.boxes]), start=message.first):
                    if np.isnan(box[0]):
                        continue
                    overlaps = [iou(box, VIEWS[name].box(place)) for place in walks[frame]]
                    assert max(overlaps) > 0.5
                    ids.add((track.id, int(np.argmax(overlaps))))
    assert len(ids) == 2, "each number is one person, in all cameras and frames"


def test_every_frame_becomes_final_once_and_in_order() -> None:
    epochs = tracked(list(walked_epochs(walk_past())))
    final = -1
    for epoch in epochs:
        for message in epoch.tracks.values():
            assert message.first == final + 1
            assert are_boxes([track.boxes for track in message.tracks], message.last - message.first + 1)
        final = next(iter(epoch.tracks.values())).final_to
        assert final >= epoch.last - LAG or final < LAG
    assert final == 39, "the end of all recordings makes the rest final"


def test_a_recording_that_ends_earlier_is_final_to_its_end() -> None:
    epochs = tracked(list(walked_epochs(walk_past(), ends={"c1": 20})))
    ended = next(epoch.tracks["c1"] for epoch in epochs if epoch.tracks["c1"].ended)
    assert (ended.last, ended.final_to) == (20, 20)
    assert are_boxes([track.boxes for track in ended.tracks], 20 - ended.first + 1)
    assert len(ended.tracks) == 2
    assert "c1" not in epochs[-1].tracks
    assert len(epochs[-1].tracks["c0"].tracks) == 2


def test_a_camera_whose_message_is_lost_is_not_taken_to_have_missed_people() -> None:
    absent = {("c0", number) for number in range(9, 14)} | {("c2", number) for number in range(9, 14)}
    epochs = tracked(list(walked_epochs(walk_past(), absent=absent)))
    ids = {track.id for epoch in epochs[8:] for message in epoch.tracks.values() for track in message.tracks}
    assert len(ids) == 2


def test_a_site_that_has_run_for_long_begins_with_the_present() -> None:
    first = 1_000_000 * STRIDE
    epochs = tracked(list(walked_epochs(walk_past(), first=first)))
    assert epochs[0].tracks["c0"].first == first
    assert {track.id for track in epochs[-1].tracks["c0"].tracks} == {1, 2}


def test_after_skipped_epochs_only_frames_since_then_are_reported() -> None:
    before = list(walked_epochs(walk_past(20)))[:-1]
    after = list(walked_epochs(walk_past(20), first=400))
    epochs = tracked([*before, *after])
    resumed = epochs[len(before)].tracks["c0"]
    assert 390 <= resumed.first <= 400 <= resumed.last
    assert len(epochs[-1].tracks["c0"].tracks) == 2


def test_a_camera_that_was_knocked_shows_boxes_where_its_picture_is_now() -> None:
    walks, motion = walk_past(), picture_motion(Motion(12.0, -7.0).homography(SIZE), SIZE)
    epochs = [
        Epoch(
            epoch.number,
            epoch.last,
            {name: msgspec.structs.replace(message, motion=motion) for name, message in epoch.tracks.items()},
        )
        for epoch in walked_epochs(walks)
    ]
    message = tracked(epochs)[10].tracks["c0"]
    for track in message.tracks:
        box = unpack_boxes([track.boxes])[0] - np.tile([12.0, -7.0], 2)
        assert max(iou(box, VIEWS["c0"].box(place)) for place in walks[message.first]) > 0.8


@pytest.mark.parametrize("is_known", [False, True])
def test_cameras_that_are_covered_say_nothing_against_people_whom_others_see(*, is_known: bool) -> None:
    whole = pack_boxes([(0.0, 0.0, float(SIZE[0]), float(SIZE[1]))])
    epochs = []
    for epoch in walked_epochs(walk_past()):
        messages = dict(epoch.tracks)
        doubted = [
            msgspec.structs.replace(frame, boxes=pack_detections(boxes, np.full(len(boxes), 0.3)))
            for frame in messages["c0"].observations
            for boxes in [unpack_detections(frame.boxes)[0]]
        ]
        messages["c0"] = msgspec.structs.replace(messages["c0"], observations=doubted)
        for name in ("c1", "c2"):
            nobody = [FrameObservations(pulse=frame.pulse) for frame in messages[name].observations]
            messages[name] = msgspec.structs.replace(
                messages[name], observations=nobody, covered=whole if is_known else b""
            )
        epochs.append(Epoch(epoch.number, epoch.last, messages))
    found = tracked(epochs)[15].tracks["c0"].tracks
    assert (len(found) == 2) is is_known


def test_looks_go_with_the_tracks() -> None:
    epochs = tracked(list(walked_epochs(walk_past())))
    samples = [
        sample for epoch in epochs for track in epoch.tracks["c1"].tracks for sample in track.appearance
    ]
    assert samples
    for sample in samples:
        assert unpack_histograms(sample.histogram, 1).max() == pytest.approx(1.0, abs=1e-3)


def test_sites_that_do_not_track_jointly_are_left_alone() -> None:
    cameras = [{"id": name, "source": "scene:room"} for name in VIEWS]
    stage = JointStage(joint_config(cameras=cameras))
    for epoch in list(walked_epochs(walk_past(6))):
        assert stage.step(epoch) is epoch
    assert SIZE == (640, 480)


def test_a_camera_that_looks_elsewhere_keeps_its_own_tracks() -> None:
    elsewhere = np.array([[1.0, 0.0, 100.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    cameras = [
        {
            "id": name,
            "source": "scene:room",
            "ground": ((elsewhere if name == "c2" else np.eye(3)) @ view.camera.homography).tolist(),
        }
        for name, view in VIEWS.items()
    ]
    stage = JointStage(joint_config(cameras=cameras))
    for epoch in list(walked_epochs(walk_past()))[:-1]:
        found = stage.step(epoch)
        assert found.tracks["c2"] is epoch.tracks["c2"]
        assert [found.is_joint(name) for name in VIEWS] == [True, True, False]
    assert {len(message.tracks) for message in found.tracks.values()} == {2}


def test_windows_that_do_not_overlap_are_tracked_too() -> None:
    window = {"length_s": 0.6, "stride_s": 0.6, "birth_s": 0.6, "min_frames": 3}
    stage = JointStage(joint_config(track={"joint": True, "window": window}))
    epochs = [stage.step(epoch) for epoch in walked_epochs(walk_past(), stride=3)]
    assert {track.id for track in epochs[-1].tracks["c0"].tracks} == {1, 2}


@pytest.mark.parametrize("fps", [10.0, 25.0, 30.0])
def test_people_are_in_every_frame_of_every_epoch_at_any_rate(fps: float) -> None:
    """Also in epochs in which no frame becomes final, since windows and keyframes do not end together."""
    config = joint_config(
        site={"name": "hall", "fps": fps, "width": SIZE[0], "height": SIZE[1]},
        encode={"gop_s": 0.2},
        track={"joint": True, "window": {"length_s": 1.0, "min_frames": 3}},
        view={"lookahead_s": 1.0},
    )
    stage = JointStage(config)
    epochs = walked_epochs(walk_past(round(4 * fps)), stride=config.window.stride)
    final = -1
    for epoch in list(map(stage.step, epochs))[:-1]:
        for name in ("c0", "c1"):
            message = epoch.tracks[name]
            assert message.first == final + 1
            if message.first > fps:
                assert len(message.tracks) == 2
                assert not np.isnan(unpack_boxes(track.boxes for track in message.tracks)).any()
        final = epoch.tracks["c0"].final_to
