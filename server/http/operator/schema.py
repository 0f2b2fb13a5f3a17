"""Answers of the operator's API; ``/api/openapi.json`` is built from them, too."""

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
    """Keys in which the file differs from the configuration in force."""


class SelectionSettings(msgspec.Struct, frozen=True):
    """View-selection settings by key, such as switch_cost_s and quality.size."""

    values: dict[str, float | bool]
    """In force now."""
    file: dict[str, float | bool]
    """In the configuration file."""
    lines: str
    """Configuration lines (YAML) for values that differ from their default or from the file."""
    min_lookahead: int
    """Frames; the tracking window needs as many."""
    max_lookahead: int
    """Frames; the service's buffers allow no more."""


class PeopleByHand(msgspec.Struct, frozen=True):
    """Manual overrides of people's identities."""

    names: dict[int, str]
    merged: dict[int, int]
    """By merged number: the number that it was merged into."""
    new_object: int | None
    """The number of the person who was just split off."""
    unavailable: str
    """Why people cannot be edited here; empty: they can."""


class Pointing(msgspec.Struct, frozen=True):
    """Corrections of position: whether they are accepted, and the result of the last request."""

    memory_frames: int
    """How many frames back a person can be pointed at."""
    max_points: int
    """Points in one request at most."""
    unavailable: str
    """Why corrections are not possible here; empty: they are."""
    accepted: int
    """Points of this request that were sent to the camera's tracker."""
    too_old: int
    """Points of this request that are too far back."""
    flags: list[int]
    """Ids of the flags that these points follow."""


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
"""The answer to GET of each path; POST, PUT and DELETE answer with the new state."""

OPERATOR_FILES = {"/api/operator/tracks.csv": "text/csv", "/api/operator/choices.csv": "text/csv"}
"""Downloads of a time range, from= and to=."""

OPERATOR_RESULTS = {
    "/api/operator/walk/ground.json": "application/octet-stream",
    "/api/operator/walk/plan.png": "image/png",
}
"""Results of the calibration walk."""
