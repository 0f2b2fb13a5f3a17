"""A site with common ground knows the people in its rooms when it searches the fewest frames."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.camera.load.load_shedder import ShedLevel, shed_levels
from server.camera.pipeline import CameraPipeline
from server.config.loader import build_config
from server.config.site_config import Config
from server.messaging.messages import CameraTracks
from server.service.ingest.epoch_aligner import Epoch
from server.service.joint_tracking.stage import JointStage
from synthetic import Scene

SECONDS = 6.0
KNOWN_AFTER_S = 3.0


def site(folder: Path, fps: float) -> Config:
    """Return a site of two cameras that see all of a room, in which one person walks."""
    scene = Scene("room", 2, 1, 11, 320, 180, fps)
    grounds = [scene.homography(camera) for camera in range(2)]
    content = {
        "site": {"fps": fps, "width": 320, "height": 180},
        "cameras": [
            {
                "id": f"c{camera}",
                "source": f"scene:room?camera={camera}&cameras=2&objects=1&seed=11",
                "ground": ground.tolist(),
            }
            for camera, ground in enumerate(grounds)
            if ground is not None
        ],
    }
    return build_config(content, where="site", folder=folder)


def shed(config: Config, level: ShedLevel) -> list[Epoch]:
    """Return the epochs of cameras that search as few frames as a level says."""
    stride, epochs = config.window.stride, list[Epoch]()
    cameras = {camera: CameraPipeline(config, camera) for camera in config.camera_ids}
    for pulse in range(int(SECONDS * config.site.fps)):
        tracks = dict[str, CameraTracks]()
        for camera, pipeline in cameras.items():
            frame, searched = pipeline.take(pulse), level.detects(pulse, stride)
            detected = pipeline.detect(pulse, frame if searched else None, skipped=not searched)
            if (message := pipeline.track_detections(detected)) is not None:
                tracks[camera] = message
        if tracks:
            epochs.append(Epoch(pulse // stride, pulse, tracks))
    for pipeline in cameras.values():
        pipeline.close()
    return epochs


@pytest.mark.parametrize("fps", [10.0, 25.0])
def test_who_is_in_the_room_is_known(tmp_path: Path, fps: float) -> None:
    config = site(tmp_path, fps)
    assert list(config.joint_cameras) == ["c0", "c1"]
    stage = JointStage(config)
    known = [stage.step(epoch) for epoch in shed(config, shed_levels(config.window.stride, live=False)[-1])]
    late = [epoch for epoch in known if epoch.last >= KNOWN_AFTER_S * fps]
    assert late
    assert all(epoch.joint and len(epoch.joint.tracks.cameras["c0"]) == 1 for epoch in late)
