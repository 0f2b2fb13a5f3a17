"""The file that a calibration is written to: what `ground:` reads, with some more keys beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bestview.calibrate import Floats


def write_ground(
    out: Path, unit: str, homographies: Mapping[str, Floats], more: Mapping[str, Any] | None = None
) -> None:
    """Write the homographies, (3, 3) each, by camera."""
    matrices = {camera: matrix.tolist() for camera, matrix in homographies.items()}
    content = {"unit": unit, "homography": matrices, **(more or {})}
    out.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
