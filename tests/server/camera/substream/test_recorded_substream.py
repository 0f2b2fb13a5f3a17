"""Tracking in a small second recording gives the tracks of the large one, in its coordinates."""

from __future__ import annotations

from collections import defaultdict
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from av.video.stream import VideoStream
from numpy.typing import NDArray

from fakes.media.videos import write_timed
from server.camera.pipeline import CameraPipeline
from server.camera.sharpness import SharpnessMemory
from server.camera.substream.picture_scale import PictureScale, SubstreamPlacement, choose_scale
from server.camera.thumbnails import encode_thumbnails
from server.cli.render.camera_workers import run_camera
from server.config.loader import build_config
from server.config.site_config import Config
from server.messaging.messages import CameraTracks
from server.messaging.packed_arrays import last_box, unpack_boxes, unpack_detections
from server.system.errors import UserError
from synthetic import Scene
from tracking.detectors.background.motion import Motion

FPS, FRAMES = 25, 90
MAIN = (640, 360)
IGNORED = [[0.0, 0.0], [200.0, 0.0], [200.0, 360.0], [0.0, 360.0]]

Picture = NDArray[np.uint8]


def resized(pictures: list[Picture], size: tuple[int, int]) -> list[Picture]:
    return [
        np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        for picture in pictures
    ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A room with people, as a main stream, one half as large, one of another shape, and a shorter one."""
    out = tmp_path_factory.mktemp("substreams")
    scene = Scene("room", 2, 3, 4, *MAIN, FPS)
    pictures = [scene.image(0, 100 + frame) for frame in range(FRAMES)]
    times = [frame / FPS for frame in range(FRAMES)]
    write_timed(out / "main.mp4", times, pictures=pictures)
    write_timed(out / "half.mp4", times, pictures=resized(pictures, (320, 180)))
    write_timed(out / "stretched.mp4", times, pictures=resized(pictures, (352, 288)))
    write_timed(out / "slow.mp4", times[::2], fps=12, pictures=resized(pictures[::2], (320, 180)))
    write_timed(out / "short.mp4", times[:50], pictures=resized(pictures[:50], (320, 180)))
    return out


def site(folder: Path, substream: str | None = None, **changes: Any) -> Config:
    camera = {"id": "c0", "source": "main.mp4", "substream": substream, **changes}
    content = {
        "site": {"fps": FPS, "width": MAIN[0], "height": MAIN[1]},
        "cameras": [camera, {"id": "c1", "source": "scene:room"}],
        "access": {"blur": "others"},
    }
    return build_config(content, where="room", folder=folder)


def run(config: Config) -> list[CameraTracks]:
    return [batch.tracks for batch in run_camera(CameraPipeline(config, "c0"), "c0")]


def boxes_by_frame(messages: list[CameraTracks]) -> dict[int, list[NDArray[np.float64]]]:
    """Return the final boxes of each frame."""
    found: dict[int, list[NDArray[np.float64]]] = defaultdict(list)
    final_before = -1
    for message in messages:
        for track in message.tracks:
            for frame, box in enumerate(unpack_boxes([track.boxes]), message.first):
                if final_before < frame <= message.final_to and np.isfinite(box).all():
                    found[frame].append(box)
        final_before = message.final_to
    return found


def iou(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    sides = np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2])
    inside = float(np.prod(np.maximum(sides, 0.0)))
    areas = float(np.prod(one[2:] - one[:2]) + np.prod(other[2:] - other[:2]))
    return inside / (areas - inside)


def overlaps(one: list[CameraTracks], other: list[CameraTracks]) -> list[float]:
    """Return for each box of a run its largest overlap with one of another run, in the same frame."""
    candidates = boxes_by_frame(other)
    return [
        max((iou(box, candidate) for candidate in candidates[frame]), default=0.0)
        for frame, boxes in boxes_by_frame(one).items()
        for box in boxes
    ]


@pytest.fixture(scope="module")
def main_tracks(folder: Path) -> list[CameraTracks]:
    return run(site(folder))


@pytest.mark.parametrize("substream", ["half.mp4", "stretched.mp4", "slow.mp4"])
def test_tracks_of_the_substream_are_those_of_the_main_stream(
    folder: Path, main_tracks: list[CameraTracks], substream: str
) -> None:
    tracks = run(site(folder, substream))
    assert {message.size for message in tracks} == {MAIN}, "the source's"
    found = overlaps(main_tracks, tracks)
    assert len(found) > FRAMES
    assert np.mean(found) > 0.75
    assert np.mean(overlaps(tracks, main_tracks)) > 0.75
    ids = {track.id for message in tracks for track in message.tracks}
    assert abs(len(ids) - len({track.id for message in main_tracks for track in message.tracks})) <= 1


def test_detections_and_ignored_areas_are_in_the_coordinates_of_the_source(folder: Path) -> None:
    messages = run(site(folder, "half.mp4", ignore=[IGNORED]))
    rows = [unpack_detections(frame.boxes)[0] for message in messages for frame in message.detections]
    boxes = np.concatenate(rows)
    assert boxes[:, 2].max() > MAIN[0] / 2, "not in those of the substream"
    middles = (boxes[:, 0] + boxes[:, 2]) / 2
    assert middles.min() > 190, "nobody is found in the ignored part"


def test_after_the_end_of_its_substream_a_recording_is_tracked_itself(folder: Path) -> None:
    pipeline = CameraPipeline(site(folder, "short.mp4"), "c0")
    frames = [pipeline.take(pulse) for pulse in range(60)]
    detected = [pipeline.detect(pulse, frame) for pulse, frame in enumerate(frames)]
    assert {frame.image.shape for frame in detected if frame.image is not None} == {(180, 320, 3)}
    assert all(frame.image is not None for frame in detected)
    assert len({frame.detections.boxes.tobytes() for frame in detected[50:]}) > 1, "it moves on"
    assert pipeline.tracked.state == "away"
    pipeline.close()


def test_a_looped_substream_begins_again_with_its_source(folder: Path) -> None:
    config = site(folder, "half.mp4", source="short.mp4", at_end="loop")
    pipeline = CameraPipeline(config, "c0")
    for pulse in range(120):
        frame = pipeline.take(pulse)
        assert frame is not None
        assert frame.image is not None
        tracked = pipeline.tracked.image(frame)
        assert tracked is not None
        small = pipeline.tracked.scale.image(frame.image)
        assert np.abs(small.astype(int) - tracked).mean() < 4, f"pulse {pulse}: another moment"
    pipeline.close()


def test_passthrough_of_a_recording_decodes_only_the_substream(folder: Path) -> None:
    config = site(folder, "half.mp4")
    pipeline = CameraPipeline(config, "c0")
    with (folder / "own.h264").open("wb") as file:
        for pulse in range(30):
            frame = pipeline.take(pulse)
            assert frame is not None
            file.write(pipeline.encode(pulse, frame).data)
    pipeline.close()
    passing = CameraPipeline(site(folder, "half.mp4", source="own.h264", passthrough="pass"), "c0")
    for pulse in range(30):
        frame = passing.take(pulse)
        assert frame is not None
        assert frame.image is None
        assert passing.encode(pulse, frame).data
        assert passing.detect(pulse, frame).image is not None
    passing.close()


@pytest.mark.parametrize(
    ("substream", "text"),
    [
        ("main.mp4", "camera c0: substream: it is the source: leave it out"),
        ("rtsp://10.0.0.1/2", "camera c0: substream: a network camera's is an address, a recording's a file"),
        ("absent.mp4", r"camera c0: substream: .*absent.mp4: no such file or folder"),
    ],
)
def test_a_wrong_substream_is_refused_with_one_line(folder: Path, substream: str, text: str) -> None:
    with pytest.raises(UserError, match=text) as refused:
        CameraPipeline(site(folder, substream), "c0")
    assert "\n" not in str(refused.value)


def test_thumbnails_and_sharpness_are_of_the_person(folder: Path, main_tracks: list[CameraTracks]) -> None:
    message = next(each for each in reversed(main_tracks) if any(last_box(t.boxes) for t in each.tracks))
    pipeline = CameraPipeline(site(folder), "c0")
    frame = None
    for pulse in range(message.last + 1):
        frame = pipeline.take(pulse)
    pipeline.close()
    assert frame is not None
    assert frame.image is not None
    scale = PictureScale((320, 180), MAIN)
    large, small = (
        {
            track: cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR).astype(int)
            for track, jpeg in thumbnails.items()
        }
        for thumbnails in (
            encode_thumbnails(frame.image, message),
            encode_thumbnails(scale.image(frame.image), message, scale),
        )
    )
    assert large.keys() == small.keys()
    for number, picture in large.items():
        same = cv2.resize(small[number].astype(np.uint8), picture.shape[1::-1]).astype(int)
        assert np.abs(same - picture).mean() < 12
    measured = SharpnessMemory().measure(message, scale.image(frame.image), scale)
    for track in measured.tracks:
        box = last_box(track.boxes)
        if box is not None and box[3] - box[1] < 100:
            assert track.sharpness is None, "too small to tell"


@pytest.mark.parametrize(
    ("site_size", "main", "substream", "tracked"),
    [
        ((1920, 1080), (1920, 1080), (640, 360), (640, 360)),
        ((1920, 1080), (1920, 1080), (704, 576), (1024, 576)),
        ((1280, 720), (1920, 1080), (2560, 1440), (1280, 720)),
        ((1280, 720), (640, 480), (320, 240), (427, 240)),
        ((1920, 1080), (1920, 1080), None, (640, 360)),
    ],
)
def test_the_tracked_picture_has_the_substreams_resolution_and_the_sites_shape(
    site_size: tuple[int, int],
    main: tuple[int, int],
    substream: tuple[int, int] | None,
    tracked: tuple[int, int],
) -> None:
    scale = choose_scale(site_size, main, substream)
    assert scale.tracked == tracked
    whole = scale.boxes_to_site(np.array([[0.0, 0.0, *map(float, tracked)]]))
    assert whole.tolist() == [[0.0, 0.0, *map(float, site_size)]]
    assert np.allclose(scale.box_from_site((0.0, 0.0, *map(float, site_size))), (0, 0, *tracked))
    moved = scale.motion_to_site(Motion(2.0, -4.0).homography(tracked))
    assert moved[0, 2] == pytest.approx(2 * site_size[0] / tracked[0])
    np.testing.assert_allclose(moved[:, :2], np.eye(3)[:, :2])


def test_a_substream_with_declared_pixels_shows_the_middle() -> None:
    placement = SubstreamPlacement((640, 360), PictureScale((320, 180), (640, 360)))
    white = np.full((288, 352, 3), 255, np.uint8)
    assert placement.image(white).min() == 255, "stretched to the whole"
    middle = placement.image(white, (384, 288))
    columns = np.nonzero(middle.max(axis=(0, 2)))[0]
    assert (columns[0], columns[-1]) == (40, 279), "4:3 in the middle of 16:9"
    assert middle[:, 160].min() == 255


def test_a_recordings_declared_pixels_are_used(folder: Path, tmp_path: Path) -> None:
    def declare(stream: VideoStream) -> None:
        stream.codec_context.sample_aspect_ratio = Fraction(12, 11)

    white = [np.full((288, 352, 3), 255, np.uint8)] * 5
    write_timed(tmp_path / "sub.mp4", [n / FPS for n in range(5)], pictures=white, prepare=declare)
    pipeline = CameraPipeline(site(folder, str(tmp_path / "sub.mp4")), "c0")
    frame = pipeline.take(0)
    assert frame is not None
    tracked = pipeline.tracked.image(frame)
    assert tracked is not None
    columns = np.nonzero(tracked.max(axis=(0, 2)) > 128)[0]
    share = (columns[-1] + 1 - columns[0]) / tracked.shape[1]
    assert share == pytest.approx((4 / 3) / (16 / 9), abs=0.02)
    pipeline.close()
