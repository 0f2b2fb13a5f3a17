"""The file that a calibration is written to: what `ground:` reads, with some more keys beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bestview.calibrate import Floats
from server.wire.output import whole_file


def write_ground(
    out: Path, unit: str, homographies: Mapping[str, Floats], more: Mapping[str, Any] | None = None
) -> None:
    """Write the homographies, (3, 3) each, by camera.

    Raises:
        UserError: the file cannot be written.
    """
    matrices = {camera: matrix.tolist() for camera, matrix in homographies.items()}
    with whole_file(out) as draft:
        content = {"unit": unit, "homography": matrices, **(more or {})}
        draft.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
