"""The camera pipeline tracks alike live and offline, and reports frames without detection."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from bestview import QualitySettings
from fakes.media.videos import HEIGHT, WIDTH, write_video
from server.camera.encoder import AccessUnit
from server.camera.pipeline import CameraPipeline
from server.camera.sources import Image, SourceEndedError
from server.cli.render.camera_workers import EpochBatch, run_camera
from server.config.loader import build_config
from server.config.sections import AccessSettings, SiteSettings
from server.config.site_config import Config
from server.messaging.messages import Box, CameraTracks
from server.messaging.packed_arrays import unpack_boxes, unpack_detections
from server.service.ingest.validation import is_plausible
from server.system.errors import UserError
from synthetic import Scene, write_recording

FRAMES = 48
STRIDE = 5
LIVE = {"prescan_s": 0}
"""The background is learned while tracking."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two views of a room with people in it, small and short."""
    out = tmp_path_factory.mktemp("recordings") / "room"
    write_recording(Scene("room", 2, 3, 4, 192, 108, 25.0), out, FRAMES / 25)
    return out


def config_of(recording: Path, *, detect: Mapping[str, Any] = MappingProxyType({}), **camera: Any) -> Config:
    content = {
        "detect": dict(detect),
        "site": {"fps": 25, "width": 192, "height": 108},
        "cameras": [{"id": "c0", "source": str(recording / "c0.mp4"), **camera}],
    }
    return build_config(content, where="site", folder=recording)


def offline(config: Config) -> list[EpochBatch]:
    return list(run_camera(CameraPipeline(config, "c0"), "c0"))


def live(config: Config, missed: frozenset[int] = frozenset()) -> tuple[list[AccessUnit], list[CameraTracks]]:
    """Run the pipeline as a live camera's process does: all video first, tracking afterwards."""
    pipeline = CameraPipeline(config, "c0")
    units, messages, backlog = [], [], []
    pulse = 0
    while True:
        if pulse not in missed:
            try:
                frame = pipeline.take(pulse)
            except SourceEndedError:
                break
            if frame is not None:
                units.append(pipeline.encode(pulse, frame))
            backlog.append((pulse, frame))
        pulse += 1
    for number, frame in backlog:
        messages.append(pipeline.track(number, frame))
    messages.append(pipeline.finish(pulse))
    pipeline.close()
    return units, [message for message in messages if message is not None]


def test_live_and_offline_give_the_same_tracks_and_the_same_bytes(recording: Path) -> None:
    config = config_of(recording)
    units, messages = live(config)
    batches = offline(config)
    assert messages == [batch.tracks for batch in batches]
    assert units == [unit for batch in batches for unit in batch.units]
    assert any(message.tracks for message in messages), "people are tracked"


def test_epochs_are_consecutive_and_the_last_ends_the_recording(recording: Path) -> None:
    batches = offline(config_of(recording))
    messages = [batch.tracks for batch in batches if batch.tracks is not None]
    assert [message.epoch for message in messages] == list(range(FRAMES // STRIDE + 1))
    assert [message.ended for message in messages] == [False] * (len(messages) - 1) + [True]
    assert [batch.ended for batch in batches] == [message.ended for message in messages]
    assert messages[-1].last == messages[-1].final_to == FRAMES - 1
    assert all(not message.shed for message in messages)


def test_an_offset_shifts_boxes_and_frames(recording: Path) -> None:
    # Without a prescan: the shifted recording has a window of frames before its first, the other has none.
    original, shifted = (
        offline(config_of(recording, offset_s=offset / 25, detect=LIVE)) for offset in (0, 2 * STRIDE)
    )
    boxes = [_boxes(batches) for batches in (original, shifted)]
    assert boxes[1] == {(pulse + 2 * STRIDE, track): box for (pulse, track), box in boxes[0].items()}
    assert [unit.pulse for batch in shifted for unit in batch.units] == list(range(10, FRAMES + 10))
    assert all(not batch.tracks.shed for batch in shifted if batch.tracks), (
        "frames before the start are not missed"
    )


def _boxes(batches: list[EpochBatch]) -> dict[tuple[int, int], Box]:
    return {
        (batch.tracks.first + place, track.id): (box[0], box[1], box[2], box[3])
        for batch in batches
        if batch.tracks is not None
        for track in batch.tracks.tracks
        for place, box in enumerate(unpack_boxes([track.boxes]).tolist())
        if not math.isnan(box[0])
    }


@pytest.mark.parametrize(("detect", "first"), [({}, 0), (LIVE, 24)], ids=["recording", "live"])
def test_recordings_are_searched_from_the_first_frame_on(
    recording: Path, detect: dict[str, Any], first: int
) -> None:
    pipeline = CameraPipeline(config_of(recording, detect=detect), "c0")
    frames = [pipeline.detect(pulse, pipeline.take(pulse)) for pulse in range(30)]
    messages = [pipeline.track_detections(frame) for frame in frames]
    pipeline.close()
    assert [frame.has_detection for frame in frames] == [pulse >= first for pulse in range(30)]
    assert [pulse for message in messages if message for pulse in message.without_detection] == list(
        range(first)
    )


def test_missed_frames_are_reported_once_and_a_missed_keyframe_begins_a_new_gop(
    recording: Path,
) -> None:
    missed = frozenset({7, 10, 11, 12, 33})
    units, messages = live(config_of(recording), missed)
    for reported in (
        [message.shed for message in messages],
        [message.without_detection for message in messages],
    ):
        assert sorted(pulse for frames in reported for pulse in frames) == sorted(missed)
    assert [unit.pulse for unit in units if unit.key] == [0, 13, 20, 30, 40]


@pytest.mark.parametrize("missed", [range(8, 11), range(9, 13), range(9, 14), range(7, 22)])
def test_missed_frames_across_the_end_of_an_epoch_leave_its_message_to_be_used(
    recording: Path, missed: range
) -> None:
    """The service refuses messages that list frames of the next epoch: its tracks would be lost."""
    _, messages = live(config_of(recording), frozenset(missed))
    assert all(is_plausible(message, STRIDE) for message in messages)
    assert sorted(pulse for message in messages for pulse in message.shed) == list(missed)


def test_only_the_end_of_a_very_long_gap_is_reported(recording: Path) -> None:
    pipeline = CameraPipeline(config_of(recording), "c0")
    late = 100_000 * STRIDE
    messages = [pipeline.track(pulse, None) for pulse in (*range(STRIDE), *range(late, late + STRIDE))]
    pipeline.close()
    shed = [message.shed for message in messages if message]
    assert max(map(len, shed)) <= 50_000 + 2 * STRIDE
    assert [pulse for reported in shed for pulse in reported][-STRIDE - 1 :] == [
        *range(late - 1, late + STRIDE)
    ]


def test_a_frame_whose_picture_was_shed_is_reported(recording: Path) -> None:
    pipeline = CameraPipeline(config_of(recording), "c0")
    for pulse in range(STRIDE):
        frame = pipeline.take(pulse)
        message = pipeline.track(pulse, None if pulse == 3 else frame)
    pipeline.close()
    assert message is not None
    assert message.shed == message.without_detection == [3]


def test_a_camera_started_after_its_recording_reports_the_end(recording: Path) -> None:
    pipeline = CameraPipeline(config_of(recording), "c0")
    with pytest.raises(SourceEndedError):
        pipeline.take(1000)
    message = pipeline.finish(1000)
    pipeline.close()
    assert message.ended
    assert (message.epoch, message.last, message.tracks) == (1000 // STRIDE, 999, [])


def test_images_of_another_size_are_letterboxed_and_messages_have_the_size(tmp_path: Path) -> None:
    write_video(tmp_path / "c0.mp4", 6)
    [*_, last] = offline(config_of(tmp_path))
    assert last.tracks is not None
    assert last.tracks.size == (WIDTH, HEIGHT)


def test_detections_of_a_file_are_tracked_in_the_sites_pixels(recording: Path) -> None:
    config = config_of(recording, detections="gt/c0.txt")
    small = config.model_copy(update={"site": SiteSettings(width=96, height=80)})
    boxes = _boxes(offline(small))
    assert boxes, "people are tracked"
    rows = np.loadtxt(recording / "gt" / "c0.txt", delimiter=",", ndmin=2)
    for (pulse, _), box in boxes.items():
        left, top, right, bottom = box  # scaled to a half, letterboxed by 13 rows
        original = (2 * left, 2 * (top - 13), 2 * (right - left), 2 * (bottom - top))
        assert np.isclose(rows[rows[:, 0] == pulse + 1, 2:6], original).all(axis=1).any()


def test_detections_are_sent_where_viewers_may_see_people_pixelated(recording: Path) -> None:
    config = config_of(recording, detections="gt/c0.txt")
    plain = [batch.tracks for batch in offline(config) if batch.tracks is not None]
    assert not any(message.detections for message in plain)
    blurred = config.model_copy(update={"access": AccessSettings(blur="others")})
    messages = [batch.tracks for batch in offline(blurred) if batch.tracks is not None]
    assert [message.tracks for message in messages] == [message.tracks for message in plain]
    found = {
        each.pulse: unpack_detections(each.boxes)[0] for message in messages for each in message.detections
    }
    rows = np.loadtxt(recording / "gt" / "c0.txt", delimiter=",", ndmin=2)
    assert set(found) == set(range(FRAMES))
    for pulse, boxes in found.items():
        assert len(boxes) == np.sum(rows[:, 0] == pulse + 1), "tracked or not"


def test_the_detections_of_a_looped_recording_repeat_with_it(recording: Path) -> None:
    config = config_of(recording, detections="gt/c0.txt", at_end="loop")
    pipeline = CameraPipeline(config, "c0")
    rounds = [
        [pipeline.detect(pulse, pipeline.take(pulse)).detections.boxes.tolist() for pulse in pulses]
        for pulses in (range(FRAMES), range(FRAMES, 2 * FRAMES))
    ]
    assert any(rounds[0]), "there are people"
    assert rounds[0] == rounds[1]


@pytest.mark.parametrize(
    ("content", "reason"), [(None, "No such file"), ("1,2,x\n", "det.txt"), (b"\xff\xfe\x00", "det.txt")]
)
def test_an_unreadable_detections_file_is_refused(
    tmp_path: Path, content: str | bytes | None, reason: str
) -> None:
    write_video(tmp_path / "c0.mp4", 3)
    if content is not None:
        (tmp_path / "det.txt").write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(UserError, match=reason) as caught:
        CameraPipeline(config_of(tmp_path, detections="det.txt"), "c0")
    assert str(caught.value).startswith("camera c0: detections: ")
    assert "\n" not in str(caught.value)


def test_a_recording_that_ends_before_the_first_pulse_is_refused_offline(recording: Path) -> None:
    with pytest.raises(UserError, match="camera c0: its recording has no pictures"):
        offline(config_of(recording, offset_s=-40))


def test_sharpness_is_measured_only_if_it_has_a_weight(recording: Path) -> None:
    config = config_of(recording)
    weighted = config.model_copy(
        update={"view": config.view.model_copy(update={"quality": QualitySettings(sharpness=0.5)})}
    )
    for tested, measured in ((config, False), (weighted, True)):
        tracks = [track for message in live(tested)[1] for track in message.tracks]
        assert tracks, "there are tracks"
        assert any(track.sharpness is not None for track in tracks) == measured
    assert live(weighted)[1] == [batch.tracks for batch in offline(weighted)]


class CoveredLater:
    """A camera whose lens is covered after some frames."""

    size, recorded = (192, 108), True

    def __init__(self, covered: int, frames: int) -> None:
        self._covered, self._frames = covered, frames
        self._room = (
            np.random.default_rng(2).integers(0, 255, (27, 48, 3), dtype=np.uint8).repeat(4, 0).repeat(4, 1)
        )

    def take(self, pulse: int) -> Image:
        if pulse >= self._frames:
            raise SourceEndedError
        return self._room if pulse < self._covered else np.full_like(self._room, 20)

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:
        return (self.take(index) for index in indices if index < self._covered)

    def close(self) -> None:
        """Nothing is open."""


def test_track_messages_have_the_condition_of_the_picture(recording: Path) -> None:
    source = CoveredLater(covered=75, frames=200)
    pipeline = CameraPipeline(config_of(recording), "c0", source=source)
    found = {batch.tracks.last: batch.tracks.condition for batch in run_camera(pipeline, "c0")}
    assert {condition for last, condition in found.items() if last < 75} == {"clear"}
    assert {condition for last, condition in found.items() if last >= 75 + 4 * 25} == {"covered"}


@pytest.mark.parametrize("joint", [True, False])
def test_a_covered_camera_says_nothing_about_the_common_ground(recording: Path, *, joint: bool) -> None:
    ground = [[0.02, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 1.0]]
    site = {"fps": 25, "width": 192, "height": 108}
    cameras = [
        {"id": name, "source": str(recording / f"{name}.mp4"), "ground": ground} for name in ("c0", "c1")
    ]
    config = build_config(
        {"site": site, "track": {"joint": joint}, "cameras": cameras}, where="site", folder=recording
    )
    pipeline = CameraPipeline(config, "c0", source=CoveredLater(covered=75, frames=200))
    told = []
    for pulse in range(200):
        frame = pipeline.detect(pulse, pipeline.take(pulse))
        message = pipeline.track_detections(frame)
        if joint and message is not None:
            told += [found.pulse for found in message.observations]
        elif frame.message is not None and frame.message.boxes is not None:
            told.append(pulse)
    pipeline.close()
    assert set(range(30, 75)) <= set(told)
    assert max(told) < 75 + 4 * 25


def test_a_homography_without_floor_in_the_picture_is_refused(recording: Path) -> None:
    ground = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 109.0]]  # the floor ends below the picture
    with pytest.raises(UserError) as caught:
        CameraPipeline(config_of(recording, ground=ground), "c0")
    assert str(caught.value).startswith("camera c0: ground: its whole image, 192x108, lies above the horizon")
    assert "\n" not in str(caught.value)
    ground[2][2] = 107.0
    CameraPipeline(config_of(recording, ground=ground), "c0")
