"""What it costs to be elsewhere than somebody who goes on as they went: not in the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.costs import CostSettings
from tracking.motion import Motion
from tracking.places import Places
from tracking.template import Template


@dataclass(frozen=True, slots=True, eq=False)
class MotionCharges:
    """What arcs to the places of a window cost objects of known motion; nothing for the others.

    Attributes:
        off_course: (n, M, K) coming from another place.
        returned: (n, M, K) coming out of hiding; infinite where nobody comes back so far off, or so unlike.
    """

    off_course: Floats
    returned: Floats


def motion_charges(
    templates: Sequence[Template], likeness: Floats, places: Places, settings: CostSettings
) -> MotionCharges | None:
    """Charge all objects; `likeness` is (n, M, K). `None` where it costs nobody anything."""
    known = any(template.motion is not None for template in templates)
    if not known or not (settings.course or settings.comeback):
        return None
    boxes = np.broadcast_to(places.boxes, (len(templates), *places.boxes.shape[1:]))
    charges = MotionCharges(np.zeros(likeness.shape), np.zeros(likeness.shape))
    for n, template in enumerate(templates):
        if template.motion is not None:
            charges.off_course[n], charges.returned[n] = _charges(
                template.motion, boxes[n], likeness[n], settings
            )
    return charges


def _charges(
    motion: Motion, boxes: Floats, likeness: Floats, settings: CostSettings
) -> tuple[Floats, Floats]:
    """Give the two charges of one object for boxes (M, K, 4), both (M, K)."""
    away, moved = motion.deviations(boxes), motion.moved(len(boxes))[:, None]
    share = np.minimum(away / (settings.slack + settings.course_drift * moved), 1.0)
    off_course = settings.course * share
    if not settings.comeback:
        return off_course, off_course
    share = away / (settings.slack + settings.comeback_drift * moved)
    returned = off_course + settings.comeback * share**2
    returned[(share > 1.0) | (likeness > settings.alike)] = np.inf
    return off_course, returned
