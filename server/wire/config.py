"""The configuration of one site: one YAML file that every process reads.

A key can be overridden from the environment: ``MYVIEW_SECTION__KEY=value`` (``MYVIEW_HTTP__PORT=8081``).
Every default is documented in ``configs/demo.yaml``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsConfigDict

from bestview import IdentitySettings, QualitySettings, checked_homography
from server.wire.detect import DetectSettings
from server.wire.library import validated
from server.wire.sound import SoundFormat
from tracking import DEFAULT_SOLVER, CostSettings, WindowSettings, solver_named

Polygon = Annotated[list[tuple[float, float]], Field(min_length=3)]
"""Corners in pixels of the camera's own picture."""

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,31}$")]
"""A name that fits into a zenoh key, a URL and a file name."""


def _even(value: int) -> int:
    if value % 2:
        raise ValueError("must be even: H.264 stores colour at half the size")
    return value


def _endpoint(value: str) -> str:
    if not _ENDPOINT.fullmatch(value):
        raise ValueError(f"{value!r} is not an address such as tcp/127.0.0.1:7447")
    return value


_ENDPOINT = re.compile(r"[a-z]+/[^\s/]+:[0-9]{1,5}([?#]\S*)?")

Endpoint = Annotated[str, AfterValidator(_endpoint)]
"""Where zenoh connects to or listens: protocol/host:port."""

Side = Annotated[int, Field(ge=16, le=8192), AfterValidator(_even)]
"""Width or height of a picture in pixels; x264 cannot encode much smaller or larger ones."""

Port = Annotated[int, Field(ge=1, le=65535)]


class Section(BaseModel):
    """A part of the configuration: a key that it does not know is an error, never ignored."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Site(Section):
    """What all cameras share. Every camera's picture is scaled to one size, so that any can follow any."""

    name: Name = "site"
    fps: Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)] = 25.0
    width: Side = 640
    height: Side = 360


class Sync(Section):
    """The pulse server."""

    host: str = "127.0.0.1"
    """Where cameras find the server."""
    bind: str = "127.0.0.1"
    """The address the server listens on."""
    port: Port = 7400
    start_timeout_s: NonNegativeFloat = 20.0
    """How long pulse 0 waits for all cameras to be there, so that recordings start at their first frame."""


class Zenoh(Section):
    """The message bus. The best-view service is its router: no separate daemon is needed."""

    connect: Endpoint = "tcp/127.0.0.1:7447"
    """Where cameras find the router."""
    listen: Endpoint = "tcp/127.0.0.1:7447"
    """Where the best-view service's router listens."""
    lease_s: PositiveFloat = 1.0
    """A process that is silent this long counts as gone."""


class Encode(Section):
    """H.264. Identical in all cameras: that is what makes cutting without re-encoding possible."""

    gop: PositiveInt = 10
    """Frames in a closed group of pictures; views can change only where one begins."""
    crf: Annotated[int, Field(ge=0, le=51)] = 23
    """x264's constant quality: smaller is better and larger; 18 to 28 is sensible."""
    preset: Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium"] = "ultrafast"


class Camera(Section):
    """One camera."""

    id: Name
    source: str
    """A file, a folder of images, a URL that FFmpeg opens, /dev/video0, or scene:NAME?camera=0&…"""
    offset: int = 0
    """A recording shows its frame n - offset at pulse n."""
    at_end: Literal["stop", "loop"] = "stop"
    """What a recording does after its last frame."""
    options: dict[str, str] = {}
    """Options for FFmpeg's opener, e.g. rtsp_transport: tcp."""
    ignore: list[Polygon] = []
    """Parts of the picture where nobody is looked for, in pixels of the camera's own picture."""
    ground: list[list[float]] | None = None
    """3x3 homography from the camera's own picture (pixels) to the ground plane."""
    detections: Path | None = None
    """A MOTChallenge detection file to use instead of looking for people in the picture."""

    @field_validator("ground")
    @classmethod
    def _ground_is_invertible(
        cls, ground: list[list[float]] | None, info: ValidationInfo
    ) -> list[list[float]] | None:
        if ground is not None:
            checked_homography(ground, f"camera {info.data.get('id', '?')}")
        return ground


class Sound(Section):
    """One sound for the whole site, under every picture."""

    source: str | None = None
    """A camera's id: that camera's sound. Or a file; None: the site has no sound."""
    offset: int = 0
    """A file's sound at pulse n is that of its moment (n - offset) / fps; a camera has its own offset."""
    at_end: Literal["stop", "loop"] = "stop"
    """What a file does after its end; a camera has its own."""
    rate: Literal[48_000, 44_100, 32_000, 24_000] = 48_000
    """Samples a second."""
    channels: Literal[1, 2] = 2
    kbps: Annotated[int, Field(ge=16, le=320)] = 96
    """Of what has to be encoded: AAC of this rate and so many channels is passed on as it is."""

    @property
    def format(self) -> SoundFormat | None:
        """What all streams of the site sound like; None: they have no sound."""
        return None if self.source is None else SoundFormat(self.rate, self.channels)


class Track(Section):
    """Following people in one camera: the network LP over a moving window (paper, II)."""

    solver: str = DEFAULT_SOLVER
    backlog_s: PositiveFloat = 2.0
    """Seconds of frames that may wait on a busy machine; a camera's older ones are left out, and said so."""
    window: Annotated[WindowSettings, validated(WindowSettings)] = WindowSettings()
    costs: Annotated[CostSettings, validated(CostSettings)] = CostSettings()

    @field_validator("solver")
    @classmethod
    def _solver_is_known(cls, solver: str) -> str:
        solver_named(solver)
        return solver


class Share(Section):
    """Several best-view services of one site: each decides for the objects whose number leaves its index."""

    of: PositiveInt = 1
    """How many there are: an object's number modulo this is the index of its service."""
    index: NonNegativeInt = 0
    """Which of them this is; 0 is the router, which the others and the cameras connect to."""
    servers: list[str] = []
    """Base URLs of all, by index: where whoever asks for another's object is sent."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.index >= self.of:
            raise ValueError(f"index is {self.index}, but of {self.of} services the last is {self.of - 1}")
        if self.servers and len(self.servers) != self.of:
            raise ValueError(f"servers names {len(self.servers)}, but there are {self.of}; name all or none")
        for server in self.servers:
            if not re.fullmatch(r"https?://[^\s/?#]+(/[^\s?#]*)?", server):
                raise ValueError(f"servers: {server!r} is not an address such as http://127.0.0.1:8081/")
        return self


class View(Section):
    """The best-view service."""

    lookahead: PositiveInt = 25
    """Frames the choice of a view looks ahead: N of the paper's section III; all of it is delay."""
    switch_cost_s: NonNegativeFloat = 0.3
    """λ: how many seconds of not seeing the person, while another camera does, are worth a cut; of a view
    that is worth half the best one it takes twice as many."""
    goes_on_s: NonNegativeFloat = 0.5
    """For how long the views at the end of the look-ahead are taken to go on as they are."""
    missed_s: NonNegativeFloat = 1.0
    """Who is not found any more is taken to be still there, less and less, for so long; 0: not at all."""
    min_shot_s: NonNegativeFloat = 0.0
    """A camera is shown for so long at least, in whole GOPs; one that sees nobody may be left sooner."""
    late_after_s: PositiveFloat = 0.5
    """How long to wait for a camera's tracks before going on without that camera."""
    buffer_s: PositiveFloat = 10.0
    """Video kept per camera."""
    quality: Annotated[QualitySettings, validated(QualitySettings)] = QualitySettings()
    """What makes a view good."""
    identity: Annotated[IdentitySettings, validated(IdentitySettings)] = IdentitySettings()
    share: Share = Share()
    """With other best-view services of the site."""


class Http(Section):
    """The page, the streams and the API."""

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8080
    viewers_max: PositiveInt = 1000
    """Streams served at once; one more gets 503."""
    viewers_per_object: PositiveInt = 1000
    """The same of one object, or of one camera."""
    viewer_queue_gops: PositiveInt = 8
    """A viewer that falls behind by more loses whole GOPs."""
    hls_segment_s: PositiveFloat = 1.0
    """As many whole GOPs as fit are a segment of HLS, at least one."""
    hls_window_s: PositiveFloat = 6.0
    """Segments that a playlist of HLS lists; twice as many are kept."""
    pictures_max: PositiveInt = 8
    """People and cameras whose pictures are decoded at once: JPEG, and boxes burnt in. One more gets 503."""
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 80


class Record(Section):
    """What was streamed, kept on the disk."""

    folder: Path | None = None
    """Where; none: nothing is recorded."""
    keep_s: PositiveFloat = 86_400.0
    """Seconds after which it is taken away."""
    most_mb: PositiveFloat = 10_000.0
    """Megabytes that it takes on the disk at most; the oldest goes first."""
    segment_s: PositiveFloat = 60.0
    """Seconds in a file: only whole files are taken away."""


class Config(BaseSettings):
    """A whole site."""

    model_config = SettingsConfigDict(
        extra="forbid",
        frozen=True,
        env_prefix="MYVIEW_",
        env_nested_delimiter="__",
    )

    site: Site = Site()
    sync: Sync = Sync()
    zenoh: Zenoh = Zenoh()
    encode: Encode = Encode()
    cameras: Annotated[list[Camera], Field(min_length=1)]
    ground: Path | None = None
    """A JSON file with one homography per camera; a camera's own `ground` goes before it."""
    sound: Sound = Sound()
    detect: Annotated[DetectSettings, validated(DetectSettings)] = DetectSettings()
    """Finding people in a picture; by default by background subtraction and box filters (paper, IV.A.2)."""
    track: Track = Track()
    view: View = View()
    http: Http = Http()
    record: Record = Record()

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Let the environment go before the file."""
        del settings_cls, dotenv_settings, file_secret_settings
        return env_settings, init_settings

    @model_validator(mode="after")
    def _cameras_have_different_names(self) -> Self:
        ids = [camera.id for camera in self.cameras]
        for camera_id in ids:
            if ids.count(camera_id) > 1:
                raise ValueError(f"cameras: two cameras are called {camera_id!r}; every id must be its own")
        return self

    @model_validator(mode="after")
    def _lookahead_covers_the_tracker(self) -> Self:
        window = self.track.window
        least = self.encode.gop + window.window - window.stride
        if self.view.lookahead < least:
            raise ValueError(
                f"view.lookahead: is {self.view.lookahead} frames but must be at least {least} "
                "(encode.gop + track.window.window - track.window.stride), "
                "so that a view is chosen on tracks that no longer change"
            )
        return self

    @property
    def sounding(self) -> str | None:
        """The camera whose process sends the sound: the one whose sound it is, or the first; None: nobody."""
        source = self.sound.source
        return source if source is None or source in self.camera_ids else self.camera_ids[0]

    def camera(self, camera_id: str) -> Camera:
        """Give one camera.

        Raises:
            KeyError: there is none of this id.
        """
        for camera in self.cameras:
            if camera.id == camera_id:
                return camera
        raise KeyError(f"no camera {camera_id!r}; there are {', '.join(self.camera_ids)}")

    @property
    def camera_ids(self) -> Sequence[str]:
        """The cameras' names in the order of the configuration: the order of every camera axis."""
        return tuple(camera.id for camera in self.cameras)
