"""Schemas of the operator API's answers, also the source of ``/api/openapi.json``."""

from __future__ import annotations

from typing import Any

import msgspec

from server.service.facade.calibration import WalkStatus
from server.service.facade.cameras import CameraDiagnostics, Floor
from server.service.facade.deletion_plan import PersonDeletion
from server.service.facade.operations import PulseClients


class CameraDiagnosticsList(msgspec.Struct, frozen=True):
    """All cameras of the site."""

    cameras: list[CameraDiagnostics]


class Setting(msgspec.Struct, frozen=True):
    """One setting in force; values are written as in the configuration file."""

    key: str
    """For example view.switch_cost_s or cameras.c0.offset."""
    value: str
    default: str | None
    """Null: the setting has no default."""
    differs: bool
    """Whether the value differs from the default."""


class Settings(msgspec.Struct, frozen=True):
    """The configuration in force."""

    settings: list[Setting]
    error: str
    """Why the configuration file on the disk is invalid; empty: it is valid."""
    changed_keys: list[str]
    """Keys in which the file differs from the configuration in force."""


class RestartStatus(msgspec.Struct, frozen=True):
    """Whether the site can be restarted here, and what that would bring into force."""

    possible: bool
    """Whether a supervisor (`myview up`) would start the processes again."""
    error: str
    """Why the configuration file cannot be used; empty: it can."""
    changed_keys: list[str]
    """Settings of the file that are not in force."""
    refused: str
    """Why the last restart went back to the earlier configuration; empty: it did not."""


class SiteCamera(msgspec.Struct, frozen=True):
    """A camera in the configuration file."""

    camera: str
    address: str
    """Without anything that may be secret."""
    substream: str
    """The same of the stream in which people are tracked; empty: it is the camera's."""
    digest: str
    """Tells whether it has changed; changes name it."""


class SiteCameras(msgspec.Struct, frozen=True):
    """The cameras in the configuration file, which may differ from those in force."""

    cameras: list[SiteCamera]
    note: str = ""
    """What has become of settings in pixels of a camera that got another address, or must be redone."""


class SearchedCamera(msgspec.Struct, frozen=True):
    """A camera that answered the search."""

    host: str
    port: int
    name: str
    hardware: str


class SearchResult(msgspec.Struct, frozen=True):
    """The cameras of the network."""

    cameras: list[SearchedCamera]
    hint: str
    """Why their streams cannot be asked for; empty: they can."""


class OfferedStream(msgspec.Struct, frozen=True):
    """A stream that a camera offers."""

    key: int
    name: str
    codec: str
    width: int
    height: int
    fps: float


class OfferedStreams(msgspec.Struct, frozen=True):
    """The streams of a camera, the largest first."""

    error: str
    needs_password: bool
    streams: list[OfferedStream]
    source: int | None = None
    """Key of the stream that is proposed for viewers."""
    substream: int | None = None
    """Key of the stream that is proposed for tracking; null: the same."""


class SiteFormat(msgspec.Struct, frozen=True):
    """Settings of the site in the configuration file, which may differ from those in force."""

    name: str
    fps: float
    width: int
    """Of the streams' pictures, pixels."""
    height: int
    digest: str
    """Tells whether they have changed."""


class ZoneRule(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A rule, on a zone or anywhere on the site."""

    rule: str
    """Its id."""
    kind: str
    """entered, left, crossed, stayed, crowded or close."""
    direction: str | None = None
    """For crossed: inward or outward; null: both."""
    longer_than_s: float | None = None
    """For stayed."""
    more_than: int | None = None
    """For crowded: the number of people."""
    closer_than_m: float | None = None
    """For close."""
    hold_s: float | None = None
    """For crowded and close: seconds for which that must last; null: the default."""
    people: list[int | str] = []
    """Numbers or names; empty: everybody."""
    days: list[str] | None = None
    """mon to sun; null: all."""
    hours: tuple[str, str] | None = None
    """From and to, HH:MM; null: all day. If it passes midnight, it belongs to the day before."""
    cameras: list[str] = []
    """It applies while each of these sends a clear picture."""


class SiteZone(msgspec.Struct, frozen=True):
    """A zone in the configuration file: an area or a line."""

    zone: str
    """Its id."""
    camera: str | None = None
    """Null: coordinates are meters, or the ground's unit, on the floor; else pixels of its own picture."""
    area: list[tuple[float, float]] | None = None
    line: list[tuple[float, float]] | None = None
    inner: tuple[float, float] | None = None
    """A point on the inner side of a line."""
    rules: list[ZoneRule] = []


class SiteZones(msgspec.Struct, frozen=True):
    """The zones in the configuration file with their rules."""

    unavailable: str
    """Why they cannot be changed here, and those in force are listed; empty: they can."""
    in_force: bool
    """Whether the service applies these zones and rules."""
    unit: str
    """Of coordinates on the floor: m, or the ground's own; empty: unknown."""
    zones: list[SiteZone]
    rules: list[ZoneRule]
    """Those that are on no zone: they apply anywhere on the site."""
    digest: str
    """Tells whether zones or rules have changed."""


class PointError(msgspec.Struct, frozen=True):
    """How far a calibration is off at a marked point."""

    floor: float
    """In the floor's unit."""
    image: float
    """In pixels of the camera's own picture."""


class PointsResult(msgspec.Struct, frozen=True):
    """A calibration from marked points."""

    lines: list[str]
    """The report."""
    errors: dict[str, list[PointError]]
    """By camera, of each of its points."""
    ground: str
    """The text of the ground file."""
    configuration: str
    """Lines for the configuration."""
    plan: bytes
    """The floor plan: PNG, in base64; empty: it could not be drawn."""


class MarkedPointsStatus(msgspec.Struct, frozen=True):
    """The calibration that the configuration file names, and one that was just computed from points."""

    unit: str | None
    """Of the floor; null: it is not given, or there is no calibration."""
    points: dict[str, list[dict[str, Any]]]
    """By camera, the points that it was computed from, as in a file of points; empty: it was from none."""
    homographies: dict[str, list[list[float]]]
    """By camera, 3x3, from pixels of its own picture to the floor."""
    digest: str
    """Tells whether it has changed; empty: there is none."""
    result: PointsResult | None


class SelectionSettings(msgspec.Struct, frozen=True):
    """View-selection settings by key, such as switch_cost_s and quality.size."""

    values: dict[str, float | bool]
    """The values in force."""
    file: dict[str, float | bool]
    """The values of the configuration file."""
    lines: str
    """Configuration lines (YAML) for values that differ from their default or from the file."""
    min_lookahead_s: float
    """The shortest, which the tracking window needs."""
    max_lookahead_s: float
    """The longest, which the service's buffers hold."""


class IdentityOverrides(msgspec.Struct, frozen=True):
    """Manual overrides of people's identities."""

    names: dict[int, str]
    merged: dict[int, int]
    """By merged number: the number that it was merged into."""
    new_object: int | None
    """The number of the person who was just split off."""
    unavailable: str
    """Why people cannot be edited here; empty: they can."""


class CorrectionStatus(msgspec.Struct, frozen=True):
    """Position corrections: whether they are accepted, and the result of the last request."""

    memory_frames: int
    """How many frames back a position can be corrected."""
    max_corrections: int
    """The most corrections in one request."""
    unavailable: str
    """Why corrections are not accepted; empty: they are."""
    accepted: int
    """Corrections of this request that were sent to the camera's tracker."""
    too_old: int
    """Corrections of this request that are too far back."""
    flags: list[int]
    """Ids of the flags that these corrections follow."""


class TrialProgress(msgspec.Struct, frozen=True):
    """A trial that has no result yet."""

    trial: int
    """Its key, to ask again."""
    ahead: int
    """Trials that must end before it begins; 0: it runs."""


OPERATOR: dict[str, type[msgspec.Struct]] = {
    "/api/operator/cameras": CameraDiagnosticsList,
    "/api/operator/pulses": PulseClients,
    "/api/operator/floor": Floor,
    "/api/operator/walk": WalkStatus,
    "/api/operator/marked_points": MarkedPointsStatus,
    "/api/operator/people": IdentityOverrides,
    "/api/operator/deletion": PersonDeletion,
    "/api/operator/position_corrections": CorrectionStatus,
    "/api/operator/config": Settings,
    "/api/operator/restart": RestartStatus,
    "/api/operator/setup/search": SearchResult,
    "/api/operator/setup/streams": OfferedStreams,
    "/api/operator/setup/trials/{key}": TrialProgress,
    "/api/operator/site_cameras": SiteCameras,
    "/api/operator/site_settings": SiteFormat,
    "/api/operator/view_selection": SelectionSettings,
    "/api/operator/zones": SiteZones,
}
"""The answer to GET of each path; POST, PUT and DELETE answer with the new state. Set-up has POST alone."""

OPERATOR_FILES = {"/api/operator/tracks.csv": "text/csv", "/api/operator/choices.csv": "text/csv"}
"""Downloads of a time range, given by from= and to=."""

OPERATOR_RESULTS = {
    "/api/operator/walk/ground.json": "application/octet-stream",
    "/api/operator/walk/plan.png": "image/png",
}
"""Results of the calibration walk."""
