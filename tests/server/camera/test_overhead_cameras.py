"""Overhead cameras: people are detected, and have one number in two of them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bestview import IdentityRegistry, IdentitySettings, TrackUpdate
from server.camera.detector_setup import make_detector
from server.camera.tracker_setup import _with_room_width
from server.cli.track.command import track_one
from server.config.loader import build_config
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from synthetic import Scene, write_recording
from tracking.baselines.temporal_consistency import TemporalSettings
from tracking.boxes import iou
from tracking.detectors import BackgroundDetector
from tracking.motchallenge import read_rows

SIZE = (640, 480)
_STRIDE = 5
_TURNED = np.array([[-1.0, 0.0, SIZE[0]], [0.0, -1.0, SIZE[1]], [0.0, 0.0, 1.0]])
"""The second camera is turned by 180 degrees."""


def _config(kind: str, **camera: object) -> Config:
    site = {"width": SIZE[0], "height": SIZE[1]}
    cameras = [
        {"id": name, "source": "scene:overhead", "kind": kind, "ground": np.eye(3).tolist(), **camera}
        for name in ("c0", "c1")
    ]
    return build_config(
        {"site": site, "cameras": cameras, "track": {"joint": False}}, where="site.yaml", folder=Path()
    )


_LEARNED, _SEARCHED = range(0, 80, 8), range(0, 60, 3)
"""Frames that the background is learned from, and frames that are searched."""


def _recall(kind: str, scene: Scene, pictures: dict[int, NDArray[np.uint8]]) -> float:
    """Return the recall of confident detections in the room from above."""
    config = _config(kind)
    detector = make_detector(config, config.cameras[0], Letterbox(SIZE, SIZE))
    assert isinstance(detector, BackgroundDetector)
    detector.prepare([pictures[frame] for frame in _LEARNED], 0.4)
    found = []
    for frame in _SEARCHED:
        detections = detector.detect(pictures[frame])
        confident = detections.boxes[detections.scores > 0.5]
        boxes = scene.truth(frame)[0].boxes
        overlaps = iou(boxes[:, None], confident[None]) if len(confident) else np.zeros((len(boxes), 1))
        found += (overlaps.max(axis=1) > 0.4).tolist()
    return float(np.mean(found))


def test_people_are_detected_from_above() -> None:
    scene = Scene("overhead", 1, 2, 4, *SIZE, 2.0)
    pictures = {frame: scene.image(0, frame) for frame in {*_LEARNED, *_SEARCHED}}
    assert _recall("overhead", scene, pictures) > 0.5
    assert _recall("upright", scene, pictures) < 0.25


def _turned(boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array(SIZE * 2) - boxes[..., [2, 3, 0, 1]]


@pytest.fixture(scope="module")
def seen_by_two() -> NDArray[np.float64]:
    """The boxes of three people in both cameras, `(2, 3, F, 4)`."""
    scene = Scene("overhead", 2, 3, 2, *SIZE, 25.0)
    boxes = np.full((2, 3, 200, 4), np.nan)
    for frame in range(boxes.shape[2]):
        for camera, truth in enumerate(scene.truth(frame)):
            boxes[camera, truth.ids - 1, frame] = _turned(truth.boxes) if camera else truth.boxes
    return boxes


def _share_with_same_number(boxes: NDArray[np.float64], overhead: tuple[str, ...]) -> float:
    """Return the share of people and frames with one number in both cameras."""
    scene = Scene("overhead", 2, 3, 2, *SIZE, 25.0)
    registry = IdentityRegistry(
        IdentitySettings(), {"c0": scene.homography(0), "c1": scene.homography(1) @ _TURNED}, overhead
    )
    same_number = []
    for last in range(_STRIDE - 1, boxes.shape[2], _STRIDE):
        first = last - _STRIDE + 1
        # Local ids differ between the cameras.
        tracks = [
            TrackUpdate(f"c{camera}", (person + camera) % 3, first, boxes[camera, person, first : last + 1])
            for camera in range(2)
            for person in range(3)
        ]
        update = registry.update(tracks, last)
        numbers = {(key.camera, key.local_id): number for key, number in update.person_ids.items()}
        if last > 100:
            pairs = [
                (numbers.get(("c0", number)), numbers.get(("c1", (number + 1) % 3))) for number in range(3)
            ]
            same_number += [one is not None and one == other for one, other in pairs]
    return float(np.mean(same_number))


def test_people_have_one_number_in_two_overhead_cameras(
    seen_by_two: NDArray[np.float64],
) -> None:
    assert _share_with_same_number(seen_by_two, ("c0", "c1")) > 0.95
    assert _share_with_same_number(seen_by_two, ()) < 0.9


def test_upright_and_overhead_cameras_are_not_peers() -> None:
    assert _config("upright").peers_of("c0") == ("c1",)
    assert not _config("overhead").peers_of("c0")
    assert _config("overhead").overhead == {"c0", "c1"}


def test_the_room_width_covers_the_letterboxed_picture() -> None:
    # Six meters across a picture of 4 by 3, which has black columns at its sides in a site of 16 by 9.
    config = _config("overhead", ground=np.diag([0.0125, 0.0125, 1.0]).tolist(), ground_unit="m")
    across = [
        _with_room_width(TemporalSettings(), config.cameras[0], Letterbox((480, 360), site)).room_m
        for site in ((480, 360), (640, 360), (960, 720))
    ]
    assert across == pytest.approx([6.0, 8.0, 6.0])


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(Exception, match="kind"):
        _config("sideways")


def test_the_track_command_tracks_two_people_from_above(tmp_path: Path) -> None:
    scene = Scene("overhead", 1, 2, 4, 320, 240, 25.0)
    write_recording(scene, tmp_path / "room", 8.0)
    assert scene.homography(0) is not None
    camera = {"id": "c0", "source": "none", "kind": "overhead", "ground": scene.homography(0).tolist()}
    site = tmp_path / "site.yaml"
    site.write_text(json.dumps({"cameras": [{**camera, "ground_unit": "m"}]}), encoding="utf-8")
    out = tmp_path / "c0.txt"
    people = track_one(
        tmp_path / "room" / "c0.mp4", None, out, site, None, lambda _: None, tracker="temporal"
    )
    assert people == 2
    boxes_of: dict[int, list[list[float]]] = {}
    for row in read_rows(out):
        box = [row.left, row.top, row.left + row.width, row.top + row.height]
        boxes_of.setdefault(row.frame - 1, []).append(box)
    overlaps = [
        float(iou(box, np.array(boxes_of[frame])).max())
        for frame in range(0, 200, 5)
        for box in scene.truth(frame)[0].boxes
    ]
    assert np.median(overlaps) > 0.5
