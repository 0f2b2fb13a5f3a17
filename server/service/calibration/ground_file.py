"""The file that a calibration is written to: what `ground:` reads, with some more keys beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from bestview.calibration import Floats


def ground_file(unit: str, homographies: Mapping[str, Floats], more: Mapping[str, Any] | None = None) -> str:
    """Give its text: the homographies, (3, 3) each, by camera."""
    matrices = {camera: matrix.tolist() for camera, matrix in homographies.items()}
    content = {"unit": unit, "homography": matrices, **(more or {})}
    return json.dumps(content, indent=1) + "\n"
