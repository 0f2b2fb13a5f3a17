"""Targets for calibration files: marked points as JSON and CSV, their floor plan, and ground.json."""

from __future__ import annotations

import json
import zlib
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

import numpy as np
from matplotlib.cbook import is_math_text

from benchmarks.fuzz.engine.mutations import as_json, mutate_bytes, mutate_value
from benchmarks.fuzz.engine.target import Target, folder, refused
from bestview.calibration import CalibrationError, fit_cameras
from server.cli.calibrate import calibration
from server.config.loader import build_config, resolve_ground_and_paths
from server.service.calibration import floor_plan
from server.service.calibration.floor_map import floor_coverage
from server.service.calibration.floor_plan_camera import FloorPlanCamera
from server.service.calibration.points_file import COLUMNS, read_points
from server.system.errors import UserError

WORDS = (
    b",", b'"', b"\n", b"\r", b"\x00", b"\xff", b"\xef\xbb\xbf", b"nan", b"NaN", b"Infinity", b"-Infinity",
    b"1e308", b"1e400", b"9" * 400, b"9" * 5000, b"[" * 3000, b"{", b"}", b"null", b"true", b"\\ud800",
    b"$", b"_", b"\\n",
)  # fmt: skip
_DRAWN_EVERY = 8192
_FEW, _MORE = (4, 4, 5, 6), (3, 8, 16)
"""Numbers of point pairs; with more than five, all subsets of four are tried, which is slow."""
_MORE_SHARE = 1 / 32
_TRUE = np.array([[0.012, 0.001, -3.0], [0.0004, 0.03, -2.0], [0.00001, 0.002, 0.2]])


def _pairs(rng: Random) -> list[dict[str, Any]]:
    """Return picture points of a camera above a floor, with their floor points."""
    pairs = []
    for _ in range(rng.choice(_MORE if rng.random() < _MORE_SHARE else _FEW)):
        x, y = rng.uniform(0, 640), rng.uniform(100, 360)
        right, far, scale = _TRUE @ (x, y, 1.0)
        pairs.append({"image": [round(x, 1), round(y, 1)], "floor": [right / scale, far / scale]})
    return pairs


def _as_csv(cameras: dict[str, list[dict[str, Any]]]) -> bytes:
    lines = [",".join(COLUMNS)]
    for camera, pairs in cameras.items():
        lines += [",".join(map(str, (camera, *pair["image"], *pair["floor"]))) for pair in pairs]
    return ("\n".join(lines) + "\n").encode()


def _points(rng: Random, cameras: dict[str, list[dict[str, Any]]]) -> bytes:
    if rng.random() < 0.4:
        data = _as_csv(cameras)
        return mutate_bytes(rng, data, WORDS) if rng.random() < 0.9 else data
    content: Any = {"unit": "m", "cameras": cameras}
    if rng.random() < 0.6:
        return as_json(mutate_value(rng, content))
    data = as_json(content)
    return mutate_bytes(rng, data, WORDS) if rng.random() < 0.9 else data


class _GroundFiles(Target):
    """Calibration files in a temporary folder, and a site that uses them."""

    def __init__(self) -> None:
        self._folder = folder()
        self._path = Path(self._folder.name)
        cameras = [{"id": camera, "source": "scene:room"} for camera in ("c0", "c1")]
        self._site = build_config({"cameras": cameras}, where="site", folder=self._path)
        self._site = self._site.model_copy(update={"ground": Path("ground.json")})

    def lay_out(self) -> None:
        """Read ground.json as a site does, and lay out its floor plan."""
        for camera in resolve_ground_and_paths(self._site, where="site", folder=self._path).cameras:
            if camera.ground is not None:
                floor_coverage(np.array(camera.ground, dtype=np.float64), (640, 360), (640, 360))

    def written(self, data: bytes) -> Path:
        """Write a file of points, as JSON or CSV by its content."""
        path = self._path / ("points.json" if data[:1] in {b"{", b"[", b'"'} else "points.csv")
        path.write_bytes(data)
        return path

    def close(self) -> None:
        """Remove the folder."""
        self._folder.cleanup()


class MarkedPoints(_GroundFiles):
    """Target for files of marked points, which are read and fitted."""

    name = "calibration-points"

    def __init__(self) -> None:
        super().__init__()
        rng = Random(1)
        self._valid = [
            {f"c{camera}": _pairs(rng) for camera in range(rng.choice((1, 1, 2)))} for _ in range(400)
        ]

    def make(self, rng: Random) -> bytes:
        """Return a file of points."""
        return _points(rng, rng.choice(self._valid))

    def feed(self, data: bytes) -> bool:
        """Read the file, and fit the cameras."""
        try:
            fits = fit_cameras(read_points(self.written(data)).cameras)
        except (UserError, CalibrationError) as error:
            return refused(error)
        assert all(np.isfinite(fit.homography).all() for fit in fits.values())
        return True


class CalibrationCommand(_GroundFiles):
    """Target for the calibrate command: homographies that the configuration accepts, a plan, printable lines.

    Drawing the plan takes hundreds of times as long as the rest, so most plans are only laid out.
    """

    name = "calibration-plans"

    def make(self, rng: Random) -> bytes:
        """Return a slightly damaged file of points."""
        cameras = {f"c{number}": _pairs(rng) for number in range(rng.choice((1, 2)))}
        content: Any = {"unit": rng.choice(("m", "$x", "", "\n", "\ud800", "$\\frac$")), "cameras": cameras}
        if rng.random() < 0.5:
            odd_name = rng.choice(("_c", "$\\frac{", "\ud800", "a\nb", "", "c" * 500, "é"))
            content["cameras"][odd_name] = _pairs(rng)
        return as_json(mutate_value(rng, content) if rng.random() < 0.3 else content)

    def feed(self, data: bytes) -> bool:
        """Calibrate, and read the result as a site's configuration does."""
        out = self._path / "ground.json"
        drawn = zlib.crc32(data) % _DRAWN_EVERY == 0
        try:
            with nullcontext() if drawn else patch.object(calibration, "plot_floor_plan", _lay_out_plan):
                lines = calibration.calibrate_points(self.written(data), out, self._path / "plan.png", None)
        except UserError as error:
            return refused(error)
        for line in lines:
            assert len(line.splitlines()) == 1, line
            line.encode()
        self.lay_out()
        return True


def _lay_out_plan(views: Sequence[FloorPlanCamera], unit: str, _: object) -> None:
    """Lay out the plan, and check that no label would be parsed as a formula."""
    for view in views:
        floor_plan._area(view)
    for text in (unit, *(view.camera for view in views)):
        assert not is_math_text(floor_plan._escape(text)), text


class GroundFile(_GroundFiles):
    """Target for the file of homographies, as a site's configuration reads it."""

    name = "calibration-ground"

    def make(self, rng: Random) -> bytes:
        """Return a ground.json."""
        content: Any = {"unit": "m", "homography": {"c0": _TRUE.tolist(), "c1": (_TRUE * 0.5).tolist()}}
        if rng.random() < 0.6:
            return as_json(mutate_value(rng, content))
        data = json.dumps(content).encode()
        return mutate_bytes(rng, data, WORDS) if rng.random() < 0.95 else data

    def feed(self, data: bytes) -> bool:
        """Load a site with the file, and lay out its floor plan."""
        (self._path / "ground.json").write_bytes(data)
        try:
            self.lay_out()
        except UserError as error:
            return refused(error)
        return True


TARGETS = (MarkedPoints, GroundFile, CalibrationCommand)
