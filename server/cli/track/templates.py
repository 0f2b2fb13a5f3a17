"""``myview track --template``: tracks objects from their boxes in the first picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from server.camera.sources import SourceEndedError, open_source
from server.cli.track.command import config_for_video, newly_final_rows, read_frames, solver_for
from server.system.atomic_write import atomic_file
from server.system.errors import UserError
from tracking import TemplateTracker
from tracking.detectors import TemplateSettings
from tracking.motchallenge import MotRow, write_rows

_NUMBERS = 4


def boxes_from(texts: Sequence[str]) -> NDArray[np.float64]:
    """Parse boxes ``LEFT,TOP,WIDTH,HEIGHT`` in pixels; return (n, 4) left, top, right, bottom.

    Raises:
        UserError: a text is not such a box.
    """
    boxes = []
    for text in texts:
        try:
            numbers = [int(part) for part in text.split(",")]
        except ValueError:
            numbers = []
        if len(numbers) != _NUMBERS or min(numbers[:2]) < 0 or min(numbers[2:]) < 1:
            raise UserError(f"--template: {text!r} is not LEFT,TOP,WIDTH,HEIGHT in pixels")
        left, top, width, height = numbers
        boxes.append((left, top, left + width, top + height))
    return np.array(boxes, dtype=np.float64).reshape(-1, _NUMBERS)


def track_templates(
    video: Path,
    boxes: NDArray[np.float64],
    out: Path,
    config: Path | None,
    solver: str | None,
    progress: Callable[[int], None],
) -> int:
    """Track the objects in boxes of the first picture and write their tracks; return the number of objects.

    Raises:
        UserError: a box is outside the picture, or a file cannot be read or written.
    """
    loaded = config_for_video(video, None, config)
    settings = loaded.track
    source = open_source(loaded.cameras[0], loaded.site)
    try:
        image = source.take(0)
        if image is None:
            raise UserError(f"{video}: has no picture")
        _check_inside(boxes, source.size)
        tracker = TemplateTracker(
            image, boxes, TemplateSettings(), settings.window, settings.costs, solver_for(loaded, solver)
        )
        rows = [MotRow.of_box(1, number, box) for number, box in enumerate(boxes.tolist(), 1)]
        with atomic_file(out, video) as draft:
            for number, picture in read_frames(source, 1):
                if picture is not None:
                    rows += newly_final_rows(tracker.push(picture))
                progress(number + 1)
            rows += newly_final_rows(tracker.flush())
            write_rows(draft, rows)
    except (SourceEndedError, ValueError) as error:
        raise UserError(f"{video}: {error}") from error
    finally:
        source.close()
    return len(boxes)


def _check_inside(boxes: NDArray[np.float64], size: tuple[int, int]) -> None:
    width, height = size
    for left, top, right, bottom in boxes.tolist():
        if right > width or bottom > height:
            raise UserError(
                f"--template: {left:g},{top:g},{right - left:g},{bottom - top:g} is not inside the "
                f"{width}x{height} picture"
            )
