"""Operator messages: predicted tracking failures from a camera, position corrections to it."""

from __future__ import annotations

from typing import Annotated

import msgspec

from server.messaging.number_types import Coordinate, Cost, Number, Pulse
from tracking.types import RiskReason

RISK_EVENTS_MAX = 32
"""Risk events that a camera reports per window at most, the riskiest ones."""


class RiskEvent(msgspec.Struct, frozen=True, kw_only=True):
    """A predicted tracking failure: an identity switch or a lost person."""

    reason: RiskReason
    tracks: Annotated[list[Number], msgspec.Meta(max_length=2)]
    """The tracks concerned, first the one to correct; empty: the whole window."""
    pulse: Pulse
    """The expected frame."""
    margin: Cost
    """Cost difference to the alternative solution: the smaller, the less certain."""
    risk: Annotated[float, msgspec.Meta(ge=0, le=1)]
    """Probability of the failure without a correction."""


CORRECTIONS_MAX = 256
"""Corrections in one message at most: ten seconds at 25 frames a second."""


TOLERANCE_MIN = 1.0
"""Smallest tolerance in pixels: clicks are not more precise."""


class CorrectedPosition(msgspec.Struct, frozen=True, kw_only=True):
    """The position of a tracked person as an operator marked it."""

    pulse: Pulse
    track: Number
    x: Coordinate
    """Pixels of the site's image, as are ``y`` and ``tolerance``."""
    y: Coordinate
    tolerance: Annotated[float, msgspec.Meta(ge=TOLERANCE_MIN, le=1e4)]
    """Largest expected error of the position."""


class PositionCorrections(msgspec.Struct, frozen=True, kw_only=True):
    """Positions of tracked people that an operator marked in one camera's image."""

    boot: Number
    """The boot of the camera that the tracks belong to."""
    corrections: Annotated[list[CorrectedPosition], msgspec.Meta(max_length=CORRECTIONS_MAX)]
