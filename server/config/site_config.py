"""The configuration of one site: one YAML file that every process reads.

A key can be overridden from the environment: ``MYVIEW_SECTION__KEY=value`` (``MYVIEW_HTTP__PORT=8081``).
Every default is documented in ``configs/demo.yaml``.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from math import gcd
from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, PrivateAttr, model_validator
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsConfigDict

from bestview import IdSeries
from server.config.sections import (
    AccessSettings,
    CameraSettings,
    EncodeSettings,
    HttpSettings,
    MqttSettings,
    RecordSettings,
    RtspSettings,
    RuleSettings,
    SiteSettings,
    SitesSettings,
    SoundSettings,
    SyncSettings,
    TrackSettings,
    ViewSettings,
    WebhookSettings,
    ZenohSettings,
    ZoneSettings,
    check_zones_and_rules,
)
from server.config.sections.detect import DetectSettings
from server.config.unknown_keys import no_unknown_keys
from tracking import ResolvedWindowSettings
from tracking.frame_rate import frames_in, seconds_up
from tracking.registry import TEMPORAL_TRACKER

PREFIX = "MYVIEW_"
_ROUNDING = 1e-9
_SERVICE = re.compile(r"bestview(-\d+)?")
"""Names of best-view services as clients of the pulse server; no camera may have one."""


class Config(BaseSettings):
    """A whole site."""

    model_config = SettingsConfigDict(
        extra="forbid",
        frozen=True,
        hide_input_in_errors=True,
        env_prefix=PREFIX,
        env_nested_delimiter="__",
    )

    site: SiteSettings = SiteSettings()
    sync: SyncSettings = SyncSettings()
    zenoh: ZenohSettings = ZenohSettings()
    sites: SitesSettings = SitesSettings()
    encode: EncodeSettings = EncodeSettings()
    cameras: Annotated[list[CameraSettings], Field(min_length=1)]
    ground: Path | None = None
    """A JSON file with one homography per camera; a camera's `ground` takes precedence."""
    sound: SoundSettings = SoundSettings()
    detect: Annotated[DetectSettings, no_unknown_keys(DetectSettings)] = DetectSettings()
    """Finding people in a picture; by default by background subtraction and box filters (paper, IV.A.2)."""
    track: TrackSettings = TrackSettings()
    view: ViewSettings = ViewSettings()
    http: HttpSettings = HttpSettings()
    access: AccessSettings = AccessSettings()
    record: RecordSettings = RecordSettings()
    rtsp: RtspSettings = RtspSettings()
    zones: Annotated[list[ZoneSettings], Field(max_length=200)] = []
    rules: Annotated[list[RuleSettings], Field(max_length=200)] = []
    webhooks: Annotated[list[WebhookSettings], Field(max_length=20)] = []
    mqtt: MqttSettings = MqttSettings()

    _of_site: tuple[str, ...] | None = PrivateAttr(None)
    """All cameras of the site, where `cameras` are those of one service."""

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Return the settings' sources by precedence: environment variables, where set, override the file."""
        del settings_cls, dotenv_settings, file_secret_settings
        is_overridden = any(name.upper().startswith(PREFIX) for name in os.environ)
        return (env_settings, init_settings) if is_overridden else (init_settings,)

    @model_validator(mode="after")
    def _cameras_have_different_names(self) -> Self:
        ids = [camera.id for camera in self.cameras]
        for camera_id in ids:
            if _SERVICE.fullmatch(camera_id):
                raise ValueError(f"cameras: {camera_id!r} is the name of a best-view service; use another id")
            if ids.count(camera_id) > 1:
                raise ValueError(f"cameras: two cameras are called {camera_id!r}; ids must be unique")
        return self

    @model_validator(mode="after")
    def _sites_fit(self) -> Self:
        if self.site.name in self.sites.link:
            raise ValueError(f"sites.link: {self.site.name!r} is this site; name the others")
        if gcd(self.sites.of, self.view.sharding.of) > 1:
            raise ValueError(
                f"sites.of: {self.sites.of} and view.sharding.of {self.view.sharding.of} have a common "
                "divisor: some shards would have nobody; set a larger sites.of, in all sites"
            )
        return self

    @model_validator(mode="after")
    def _zones_and_rules_fit(self) -> Self:
        check_zones_and_rules(self.zones, self.rules, self.camera_ids)
        rules = [rule.id for rule in self.rules]
        for number, webhook in enumerate(self.webhooks):
            for rule in webhook.rules:
                if rule not in rules:
                    known = f"there are {', '.join(rules)}" if rules else "there are none"
                    raise ValueError(f"webhooks.{number}: rules: there is no rule {rule!r}; {known}")
        return self

    @model_validator(mode="after")
    def _areas_have_all_cameras(self) -> Self:
        areas = self.view.sharding.areas
        if areas and self.sites.of > 1:
            raise ValueError("view.sharding.areas: a site that is linked to others (sites) cannot have areas")
        named = {camera for area in areas for camera in area.cameras}
        for camera in sorted(named.difference(self.camera_ids)):
            known = ", ".join(self.camera_ids)
            raise ValueError(f"view.sharding.areas: there is no camera {camera!r}; there are {known}")
        for rule in self.rules if areas else ():
            if not any(set(rule.cameras) <= {*area.cameras, *area.also} for area in areas):
                raise ValueError(f"rules: {rule.id}: no area has all of its cameras (view.sharding.areas)")
        for camera in self.camera_ids if areas else ():
            if camera not in named:
                raise ValueError(
                    f"view.sharding.areas: camera {camera} is in none; name it in that of its place"
                )
        return self

    @model_validator(mode="after")
    def _lookahead_covers_the_tracker(self) -> Self:
        if "lookahead_s" not in self.view.model_fields_set and self.lookahead < self.least_lookahead:
            seconds = self.least_lookahead / self.site.fps
            object.__setattr__(self, "view", self.view.model_copy(update={"lookahead_s": seconds}))
        self.check_lookahead(self.view)
        return self

    @property
    def least_lookahead(self) -> int:
        """The fewest look-ahead frames, after which tracks no longer change."""
        return self.gop + self.track.final_lag(self.site.fps)

    @property
    def gop(self) -> int:
        """The frames in a GOP."""
        return self.encode.frames_per_gop(self.site.fps)

    @property
    def lookahead(self) -> int:
        """The frames of the look-ahead, N."""
        return self.lookahead_of(self.view)

    def lookahead_of(self, view: ViewSettings) -> int:
        """Return the frames of the look-ahead under other settings."""
        return frames_in(view.lookahead_s, self.site.fps)

    @property
    def window(self) -> ResolvedWindowSettings:
        """The trackers' window at the site's frame rate."""
        return self.track.window.resolve(self.site.fps)

    def check_lookahead(self, view: ViewSettings) -> None:
        """Check that these settings look far enough ahead.

        Raises:
            ValueError: they do not.
        """
        if self.lookahead_of(view) < self.least_lookahead:
            lag = "track.window.length_s - stride_s, in whole frames"
            if self.track.tracker == TEMPORAL_TRACKER:
                lag = "all stages of track.temporal, less a frame"
            raise ValueError(
                f"view.lookahead_s: is {view.lookahead_s:g} s but must be at least "
                f"{seconds_up(self.least_lookahead, self.site.fps):g} (encode.gop_s + {lag}), "
                "so that a view is chosen on tracks that no longer change"
            )

    @model_validator(mode="after")
    def _settled_after_published(self) -> Self:
        identity = self.view.identity
        least = identity.publish_after_s + 2.0 * identity.clustering_interval_s
        if identity.settle_after_s < least - _ROUNDING:
            raise ValueError(
                f"view.identity.settle_after_s: is {identity.settle_after_s:g} seconds but must be "
                f"at least {least:g} (publish_after_s + 2 * clustering_interval_s), "
                "so that a settled person has been published"
            )
        return self

    @model_validator(mode="after")
    def _streams_can_be_of_this_codec(self) -> Self:
        for place, wanted in (("record.folder", self.record.folder), ("sound.source", self.sound.source)):
            if self.encode.codec == "vp8" and wanted is not None:
                raise ValueError(f"{place}: a site whose encode.codec is vp8 has none; use h264 or h265")
        if self.encode.codec == "vp8" and self.rtsp.enabled:
            raise ValueError("rtsp.enabled: a site whose encode.codec is vp8 has no RTSP; use h264 or h265")
        for camera in self.cameras:
            if self.encode.codec == "vp8" and camera.passthrough != "off":
                raise ValueError(
                    f"cameras: {camera.id}: passthrough: {camera.passthrough}: encode.codec is vp8"
                )
        return self

    @property
    def audio_sender(self) -> str | None:
        """The camera whose process sends the sound: its source, or the first for a file; None: no sound."""
        source = self.sound.source
        cameras = self.site_camera_ids
        return source if source is None or source in cameras else cameras[0]

    def peers_of(self, camera_id: str) -> Sequence[str]:
        """Return the cameras whose detections a camera uses: of the common ground; none if disabled.

        Where people are tracked jointly, detections are joined there instead.
        """
        calibrated = self._calibrated
        if not self.track.cross_view.enabled or self.track.is_joint or camera_id not in calibrated:
            return ()
        return tuple(peer for peer in calibrated if peer != camera_id)

    @property
    def joint_cameras(self) -> Sequence[str]:
        """The cameras whose people are tracked jointly where they overlap; none with fewer than two."""
        calibrated = self._calibrated if self.track.is_joint else ()
        return calibrated if len(calibrated) > 1 else ()

    @property
    def _calibrated(self) -> Sequence[str]:
        """The cameras with a homography in which people stand upright."""
        return tuple(
            camera.id for camera in self.cameras if camera.ground is not None and camera.kind == "upright"
        )

    @property
    def overhead(self) -> frozenset[str]:
        """The cameras that look straight down."""
        return frozenset(camera.id for camera in self.cameras if camera.kind == "overhead")

    def camera(self, camera_id: str) -> CameraSettings:
        """Return one camera.

        Raises:
            KeyError: there is no camera with this id.
        """
        for camera in self.cameras:
            if camera.id == camera_id:
                return camera
        raise KeyError(f"no camera {camera_id!r}; there are {', '.join(self.camera_ids)}")

    def of_service(self) -> Self:
        """Return the configuration of this best-view service, with the cameras and zones of its area."""
        taken = self.view.sharding.cameras
        if taken is None or self._of_site is not None:
            return self
        zones = [zone for zone in self.zones if zone.camera is None or zone.camera in taken]
        known = {None, *(zone.id for zone in zones)}
        own = self.model_copy(
            update={
                "cameras": [camera for camera in self.cameras if camera.id in taken],
                "zones": zones,
                "rules": [
                    rule for rule in self.rules if rule.zone in known and set(rule.cameras) <= set(taken)
                ],
            }
        )
        own._of_site = tuple(self.camera_ids)  # noqa: SLF001 — of a copy
        return own

    @property
    def person_numbers(self) -> IdSeries:
        """The person numbers that this service assigns."""
        return self.view.sharding.ids if self.view.sharding.areas else self.sites.ids

    @property
    def site_camera_ids(self) -> Sequence[str]:
        """The names of all cameras of the site, also of those that this service does not take in."""
        return self.camera_ids if self._of_site is None else self._of_site

    @property
    def camera_ids(self) -> Sequence[str]:
        """The cameras' names in the order of the configuration: the order of every camera axis."""
        return tuple(camera.id for camera in self.cameras)
