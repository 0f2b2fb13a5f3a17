"""What the operator's addresses answer. ``/api/openapi.json`` is made from these, too."""

from __future__ import annotations

import msgspec

from server.http.api.schema import CameraInfo
from server.service.metrics.camera_metrics import CameraProblem, RecentSeconds


class OwnPicture(msgspec.Struct, frozen=True):
    """A camera's own picture, and how it lies in the site's: site = own · scale + (left, top), in pixels."""

    width: int
    height: int
    scale: float
    left: float
    top: float


class OperatorCamera(CameraInfo, frozen=True):
    """How one camera is, in all that is measured of it: what /api/cameras says, and more."""

    bad_messages: int
    clock_offset: float | None
    """Seconds, pulse server's clock minus the camera's; null: not known."""
    sync_error: RecentSeconds | None
    """Seconds from the moment a frame was due to the moment it was taken, of the last ten seconds or so."""
    tracking_delay: RecentSeconds | None
    """Seconds from the moment a window's last frame was due to the moment the window was solved."""
    certified: float | None
    """Share of the windows whose answer is proven to be the optimum."""
    windows: int
    """How many windows that is about."""
    last_trouble: CameraProblem | None
    """What last went wrong, and when; it stays when the camera is well again."""
    picture: OwnPicture | None
    """Null: it has not said."""


class OperatorCameras(msgspec.Struct, frozen=True):
    """All cameras of the site."""

    cameras: list[OperatorCamera]


class PulseListener(msgspec.Struct, frozen=True):
    """A client of the pulse server."""

    name: str | None
    """Null: it only listens."""
    expected: bool
    """The configuration names it."""
    behind: int
    """Pulses that it has just lost because it did not read."""


class Pulses(msgspec.Struct, frozen=True):
    """The pulse server's clients."""

    server: str
    """Its host and port."""
    error: str
    """Why nothing is known; empty: it has answered."""
    clients: list[PulseListener]
    missing: list[str]
    """Who is named in the configuration and not there."""


class FloorCamera(msgspec.Struct, frozen=True):
    """What one camera covers of the floor that all share."""

    camera: str
    homography: list[list[float]]
    """3x3, from pixels of the site's picture to the floor; below 0 in the third: above the horizon."""
    outline: list[list[float]]
    """Corners, x and y on the floor; empty: it sees none of it."""


class Floor(msgspec.Struct, frozen=True):
    """The floor plan."""

    cameras: list[FloorCamera]
    """Those that are calibrated and have said how large their own picture is."""
    uncalibrated: list[str]


class WalkCamera(msgspec.Struct, frozen=True):
    """What one camera has seen of a walk."""

    camera: str
    feet: int
    """Feet that were seen while another camera saw somebody, too, some five a second."""
    thirds: list[float]
    """What shares of them were in the left, the middle and the right third of the picture."""
    deep: float | None
    """How many times as tall the nearest of them appear as the farthest; null: too few were seen."""


class WalkPair(msgspec.Struct, frozen=True):
    """For how many seconds two cameras saw somebody at once."""

    one: str
    other: str
    seconds: float


class OperatorWalk(msgspec.Struct, frozen=True):
    """The walk that the cameras are calibrated from."""

    state: str
    """none, walking, working (it is calibrated from) or done."""
    seconds: float
    """For how long was walked."""
    most: float
    """Seconds after which nothing more is taken in."""
    cameras: list[WalkCamera]
    pairs: list[WalkPair]
    lacking: list[str]
    """Where to walk, too, as far as can be told before it is calibrated from."""
    error: str
    """Why nothing has come of it; empty: something has, or it is not done."""
    lines: list[str]
    """What has come of it, in words."""
    too_little: str
    """What was not walked, where the result is a guess for want of that; else empty."""
    configuration: str
    """The lines for the configuration; empty: there is no ground file."""


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
    waiting: list[str]
    """Keys in which the file differs from what is in force."""


class Choosing(msgspec.Struct, frozen=True):
    """What views are chosen by; keys such as switch_cost_s and quality.size."""

    values: dict[str, float | bool]
    """In force now."""
    file: dict[str, float | bool]
    """What the configuration says."""
    lines: str
    """Of the configuration, for what is in force and is not its default or not what the file says."""
    least_lookahead: int
    """Frames, as few as tracks allow."""
    most_lookahead: int
    """Frames, as many as what the service keeps allows."""


class PeopleByHand(msgspec.Struct, frozen=True):
    """What was said of people by hand."""

    names: dict[int, str]
    merged: dict[int, int]
    """By number that was merged by hand: whose it is said to be."""
    parted: int | None
    """The number of somebody who was just said to be new."""
    cannot: str
    """Why nothing can be said here; empty: it can."""


class Pointing(msgspec.Struct, frozen=True):
    """What becomes of it where the operator points."""

    memory: int
    """How many frames back somebody can be pointed at."""
    most: int
    """Places in one request at most."""
    cannot: str
    """Why nobody can be pointed at here; empty: they can."""
    taken: int
    """Of the places that were just sent, those that the camera is told."""
    left_out: int
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
    "/api/operator/choosing": Choosing,
}
"""What GET of each address answers; what changes something answers with the same, as it is then."""

OPERATOR_FILES = {"/api/operator/tracks.csv": "text/csv", "/api/operator/choices.csv": "text/csv"}
"""What is given of a time span, from= and to=."""

OPERATOR_RESULTS = {
    "/api/operator/walk/ground.json": "application/octet-stream",
    "/api/operator/walk/plan.png": "image/png",
}
"""What has come of a walk."""
