"""Messages between tracker and operator: predicted failures to the operator, marked positions back."""

from __future__ import annotations

from typing import Annotated

import msgspec

from server.messaging.number_types import Coordinate, Cost, Number, Pulse
from tracking.types import RiskReason

RISK_EVENTS_MAX = 32
"""Troubles that a camera tells of one window at most; the riskiest ones."""


class RiskEvent(msgspec.Struct, frozen=True, kw_only=True):
    """A predicted tracking failure: an identity switch or a lost person."""

    reason: RiskReason
    tracks: Annotated[list[Number], msgspec.Meta(max_length=2)]
    """Whom it is about, first whom to point at; none: the window."""
    pulse: Pulse
    """When that is expected."""
    margin: Cost
    """By how much the solution that is taken costs less than the other one: the smaller the less sure."""
    risk: Annotated[float, msgspec.Meta(ge=0, le=1)]
    """How likely it is to go wrong unless somebody helps."""


OPERATOR_POINTS_MAX = 256
"""Places that are pointed at in one message at most: ten seconds at 25 frames a second."""


TOLERANCE_MIN = 1.0
"""Pixels by which any pointing may be off: nobody points better."""


class OperatorPoint(msgspec.Struct, frozen=True, kw_only=True):
    """The position of a tracked person as an operator marked it."""

    pulse: Pulse
    track: Number
    x: Coordinate
    """Pixels of the site's picture, as ``y`` and ``reach``."""
    y: Coordinate
    tolerance: Annotated[float, msgspec.Meta(ge=TOLERANCE_MIN, le=1e4)]
    """How far off the pointing may be."""


class OperatorPoints(msgspec.Struct, frozen=True, kw_only=True):
    """Positions that an operator marked in one camera's picture."""

    boot: Number
    """The run of the camera whose tracks are named."""
    points: Annotated[list[OperatorPoint], msgspec.Meta(max_length=OPERATOR_POINTS_MAX)]
