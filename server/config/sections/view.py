"""The section `view`: view selection."""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated, Self

from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt, model_validator

from bestview import IdentitySettings, IdSeries, QualitySettings
from server.config.sections.base import Identifier, PageUrl, Section
from server.config.unknown_keys import no_unknown_keys
from tracking.types import RiskReason

LIVE_VIEW_SETTINGS = (
    "lookahead_s",
    "switch_cost_s",
    "extrapolate_s",
    "presence_decay_s",
    "undetected_weight",
    "min_shot_s",
    "quality",
)
"""View-selection settings that can be changed while the service runs."""

Seconds = Annotated[float, Field(ge=0, le=3600)]


class AreaSettings(Section):
    """A part of the site that has a best-view service of its own."""

    cameras: Annotated[list[Identifier], Field(min_length=1)]
    """People whom most of them see are in the area."""
    also: list[Identifier] = []
    """Cameras of other areas that see a part of it: who comes or goes keeps their number."""
    floor: tuple[float, float, float, float] | None = None
    """Least x and y, largest x and y on the ground: then who stands there is in the area, whichever cameras
    see them, and nobody beyond `margin` is taken in."""
    margin: NonNegativeFloat = 5.0
    """In units of the ground. Who walks in is known to both areas for as long as that takes."""

    @model_validator(mode="after")
    def _has_a_floor(self) -> Self:
        if self.floor is not None and not (self.floor[0] < self.floor[2] and self.floor[1] < self.floor[3]):
            raise ValueError(
                f"floor: {list(self.floor)} is no rectangle: give its least x and y, then its largest"
            )
        return self


class ShardingSettings(Section):
    """Several best-view services of one site: for one shard of the people each, and to replace each other."""

    of: PositiveInt = 1
    """Number of shards: a service decides for people whose number has its index's remainder by this. Services
    of one shard replace each other."""
    areas: list[AreaSettings] = []
    """One for each shard: a service then takes in only the cameras of its area, and decides for the people
    there. None: every service takes in all cameras."""
    index: NonNegativeInt = 0
    """Index of this service."""
    servers: list[PageUrl] = []
    """Base URLs of all services, by index; viewers go on there when this one dies. None: `of` services."""

    @property
    def editing_blocked(self) -> str:
        """Why operators cannot change people's numbers; empty: they can."""
        if self.services > 1:
            return "the site has several services (view.sharding), and their person numbers must stay equal"
        return ""

    @property
    def services(self) -> int:
        """Number of services."""
        return len(self.servers) or self.of

    @property
    def shard(self) -> int:
        """The shard of this service."""
        return self.shard_of_service(self.index)

    def shard_of_service(self, index: int) -> int:
        """Return the shard of a service, by its index."""
        return index % self.of

    @property
    def is_first(self) -> bool:
        """Whether no service before this one has the same people: it alone evaluates rules about them."""
        return self.index < (self.of if self.areas else 1)

    @property
    def cameras(self) -> Collection[str] | None:
        """The cameras that this service takes in; None: all."""
        if not self.areas:
            return None
        area = self.areas[self.shard]
        return [*area.cameras, *area.also]

    @property
    def keepers(self) -> Collection[str] | None:
        """The cameras that keep what this service knows of people, for when it restarts; None: all.

        A camera keeps it for one service.
        """
        return self.areas[self.shard].cameras if self.areas else None

    @property
    def ids(self) -> IdSeries:
        """The person numbers that this service assigns: each area has its own."""
        return IdSeries(self.shard, self.of) if self.areas else IdSeries()

    @model_validator(mode="after")
    def _areas_fit(self) -> Self:
        if self.areas and len(self.areas) != self.of:
            raise ValueError(f"areas: has {len(self.areas)}, but there are {self.of} shards (of)")
        names = [camera for area in self.areas for camera in area.cameras]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(
                    f"areas: camera {name} is in two; name it in also of the one it sees less of"
                )
        for number, area in enumerate(self.areas):
            for name in area.also:
                if name in area.cameras or name not in names:
                    raise ValueError(f"areas.{number}: also: {name!r} is not a camera of another area")
        return self

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.servers and len(self.servers) % self.of:
            raise ValueError(
                f"servers names {len(self.servers)}, but there are {self.of} shards; "
                "name as many for each, or none"
            )
        if self.index >= self.services:
            raise ValueError(
                f"index is {self.index}, but of {self.services} services the last is {self.services - 1}"
            )
        return self


class FlagSettings(Section):
    """Flags: predicted identity failures that an operator is asked to look at."""

    per_minute: Annotated[int, Field(ge=0, le=600)] = 2
    """Flags raised a minute at most, where identities are likeliest to fail; those of 3 minutes are saved."""
    risk: Annotated[float, Field(ge=0, le=1)] = 0.1
    """Least predicted probability of a failure for which a flag is raised."""
    reasons: list[RiskReason] = ["crossing", "id_switch", "track_loss", "optimality_gap"]
    """The kinds of predicted failures for which flags are raised."""
    answer_s: Annotated[float, Field(gt=0, le=600)] = 8.0
    """Seconds after the expected moment in which a flag can be answered; see `track.assist.memory_s`."""


class ViewSettings(Section):
    """The best-view service."""

    lookahead_s: Annotated[float, Field(gt=0, le=600)] = 1.0
    """Seconds that view selection looks ahead: N of the paper's section III; all of it is delay. By default a
    second, or as long as the tracks need."""
    live_lag_s: Annotated[float, Field(ge=0, le=60)] = 0.2
    """Delay live: seconds before a GOP whose frames no longer count for its view: tracking takes them."""
    live_horizon_s: Annotated[float, Field(gt=0, le=60)] = 1.5
    """Delay live: seconds for which the newest views are taken to stay; a cut must gain its cost in them."""
    smooth_lookahead_s: Annotated[float, Field(gt=0, le=600)] = 3.0
    """Delay smooth: its look-ahead, in whole GOPs more than `lookahead_s`; at least that."""
    switch_cost_s: Seconds = 0.3
    """λ: a cut costs as much as so many seconds of not seeing the person while another camera does; or twice
    as many of a view worth half the best one."""
    extrapolate_s: Seconds = 0.5
    """Seconds after the look-ahead for which its last views are assumed to stay as they are."""
    presence_decay_s: Seconds = 1.0
    """Seconds over which a view decays to nothing after the last detection of the person; 0: at once."""
    undetected_weight: Annotated[float, Field(ge=0, le=1)] = 1.0
    """Weight of a view in which the camera does not detect the person, where other cameras see that they
    stand before it; 0: such views count for nothing."""
    min_shot_s: Annotated[float, Field(ge=0, le=600)] = 0.0
    """Minimum shot length, in whole GOPs; a camera that does not see the person may be left sooner."""
    late_after_s: PositiveFloat = 0.5
    """How long to wait for a camera's tracks before going on without that camera."""
    buffer_s: PositiveFloat = 10.0
    """Video kept per camera."""
    quality: Annotated[QualitySettings, no_unknown_keys(QualitySettings)] = QualitySettings()
    """What makes a view good."""
    identity: Annotated[IdentitySettings, no_unknown_keys(IdentitySettings)] = IdentitySettings()
    flags: FlagSettings = FlagSettings()
    """Which of the failures that `track.assist` predicts are flagged."""
    sharding: ShardingSettings = ShardingSettings()
    """Sharding over several best-view services."""
