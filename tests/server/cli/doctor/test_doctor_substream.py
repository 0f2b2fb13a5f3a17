"""`myview doctor` says whether a substream opens and shows what its source shows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fakes.cli.doctor_configs import load_site
from fakes.media.two_streams import FPS, GOP, MAIN, TwoStreamCamera
from fakes.media.videos import write_timed
from server.cli.doctor.cameras import camera_findings, probe_cameras
from server.cli.doctor.findings import Level
from server.config.site_config import Config

SITE = {"name": "hall", "width": MAIN[0], "height": MAIN[1], "fps": FPS}


def pattern(size: tuple[int, int], seed: int = 1) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """Return a picture of 8 by 4 gray fields."""
    fields = np.random.default_rng(seed).integers(20, 235, (4, 8, 1), dtype=np.uint8)
    rows, columns = np.arange(size[1]) * 4 // size[1], np.arange(size[0]) * 8 // size[0]
    return np.repeat(fields[rows][:, columns], 3, axis=2)


def film(
    folder: Path, name: str, size: tuple[int, int], *, fps: int = FPS, seed: int = 1, frames: int = 12
) -> None:
    write_timed(
        folder / name, [n / fps for n in range(frames)], fps=fps, pictures=[pattern(size, seed)] * frames
    )


def reported(config: Config) -> list[tuple[Level, str]]:
    """Return the levels and texts about the substream."""
    found = camera_findings(config, probe_cameras(config, 8.0), runs=False)
    return [(finding.level, finding.text) for finding in found if "substream" in finding.text]


@pytest.mark.parametrize(
    ("made", "level", "text"),
    [
        ({"size": (160, 96)}, Level.OK, "substream: 160x96 pixels, 25.0 pictures a second"),
        ({"size": (160, 96), "seed": 2}, Level.WARNING, "it shows another picture than the source"),
        (
            {"size": (128, 96)},
            Level.WARNING,
            "128x96, another shape than the source's 320x192: it is",
        ),
        ({"size": (320, 192)}, Level.WARNING, "320x192, not smaller than the source's 320x192"),
        (
            {"size": (160, 96), "fps": 10},
            Level.WARNING,
            "10.0 pictures a second, the source has 25.0: boxes are up to 50 ms apart from the picture",
        ),
    ],
)
def test_a_substream_is_compared_with_its_source(
    tmp_path: Path, made: dict[str, Any], level: Level, text: str
) -> None:
    film(tmp_path, "c0.mp4", MAIN)
    film(tmp_path, "small.mp4", **made)
    cameras = [{"id": "c0", "source": "c0.mp4", "substream": "small.mp4"}]
    (finding,) = reported(load_site(tmp_path, site=SITE, cameras=cameras))
    assert finding[0] is level
    assert text in finding[1]


def test_a_network_cameras_substream_is_measured_or_its_absence_reported(tmp_path: Path) -> None:
    camera = TwoStreamCamera()
    source = {
        "id": "c0",
        "source": camera.main.url,
        "substream": camera.sub.url,
        "passthrough": "pass",
        "options": {"rtsp_transport": "tcp"},
    }
    encode = {"gop_s": GOP / FPS, "parameters": "own"}
    config = load_site(tmp_path, site=SITE, cameras=[source], encode=encode)
    try:
        assert reported(config) == [(Level.OK, "substream: 160x96 pixels, 25.0 pictures a second")]
        camera.sub.close()
        ((level, text),) = reported(config)
        assert level is Level.WARNING
        assert "substream: rtsp://127.0.0.1" in text
        assert "Connection refused" in text
    finally:
        camera.close()
