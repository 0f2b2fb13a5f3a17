"""What the operator's addresses answer. ``/api/openapi.json`` is made from these, too."""

from __future__ import annotations

import msgspec

from server.service.facade.calibration import OperatorWalk
from server.service.facade.cameras import Floor, OperatorCamera
from server.service.facade.operations import Pulses


class OperatorCameras(msgspec.Struct, frozen=True):
    """All cameras of the site."""

    cameras: list[OperatorCamera]


class Setting(msgspec.Struct, frozen=True):
    """One setting that is in force. Values are as the configuration writes them."""

    key: str
    """Such as view.switch_cost_s, or cameras.c0.offset."""
    value: str
    default: str | None
    """Null: it has none."""
    differs: bool
    """From the default."""


class Settings(msgspec.Struct, frozen=True):
    """The configuration that is in force."""

    settings: list[Setting]
    error: str
    """Why the file, as it is on the disk now, cannot be in force; empty: it can."""
    pending_restart: list[str]
    """Keys in which the file differs from what is in force."""


class SelectionSettings(msgspec.Struct, frozen=True):
    """What views are chosen by; keys such as switch_cost_s and quality.size."""

    values: dict[str, float | bool]
    """In force now."""
    file: dict[str, float | bool]
    """What the configuration says."""
    lines: str
    """Of the configuration, for what is in force and is not its default or not what the file says."""
    min_lookahead: int
    """Frames, as few as tracks allow."""
    max_lookahead: int
    """Frames, as many as what the service keeps allows."""


class PeopleByHand(msgspec.Struct, frozen=True):
    """What was said of people by hand."""

    names: dict[int, str]
    merged: dict[int, int]
    """By number that was merged by hand: whose it is said to be."""
    new_object: int | None
    """The number of somebody who was just said to be new."""
    unavailable: str
    """Why nothing can be said here; empty: it can."""


class Pointing(msgspec.Struct, frozen=True):
    """What becomes of it where the operator points."""

    memory_frames: int
    """How many frames back somebody can be pointed at."""
    max_points: int
    """Places in one request at most."""
    unavailable: str
    """Why nobody can be pointed at here; empty: they can."""
    accepted: int
    """Of the places that were just sent, those that the camera is told."""
    too_old: int
    """Those that it is not told: too far back."""
    flags: list[int]
    """The flags that are followed by them."""


OPERATOR: dict[str, type[msgspec.Struct]] = {
    "/api/operator/cameras": OperatorCameras,
    "/api/operator/pulses": Pulses,
    "/api/operator/floor": Floor,
    "/api/operator/walk": OperatorWalk,
    "/api/operator/people": PeopleByHand,
    "/api/operator/pointing": Pointing,
    "/api/operator/config": Settings,
    "/api/operator/view_selection": SelectionSettings,
}
"""What GET of each address answers; what changes something answers with the same, as it is then."""

OPERATOR_FILES = {"/api/operator/tracks.csv": "text/csv", "/api/operator/choices.csv": "text/csv"}
"""What is given of a time span, from= and to=."""

OPERATOR_RESULTS = {
    "/api/operator/walk/ground.json": "application/octet-stream",
    "/api/operator/walk/plan.png": "image/png",
}
"""What has come of a walk."""
