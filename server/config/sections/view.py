"""The section `view`: view selection."""

from __future__ import annotations

import re
from typing import Annotated, Self

from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt, model_validator

from bestview import IdentitySettings, QualitySettings
from server.config.sections.base import Section
from server.config.unknown_keys import no_unknown_keys
from tracking.types import RiskReason

LIVE_VIEW_SETTINGS = (
    "lookahead",
    "switch_cost_s",
    "extrapolate_s",
    "presence_decay_s",
    "undetected_weight",
    "min_shot_s",
    "quality",
)
"""Settings of the choice that can be changed while it runs."""

Seconds = Annotated[float, Field(ge=0, le=3600)]


class ShareSettings(Section):
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
        for number, server in enumerate(self.servers):
            if not re.fullmatch(r"https?://[^\s/?#]+(/[^\s?#]*)?", server):
                raise ValueError(f"servers.{number}: is not an address such as http://127.0.0.1:8081/")
        return self


class FlagSettings(Section):
    """Flags: where an operator is asked to look."""

    per_minute: Annotated[int, Field(ge=0, le=600)] = 2
    """Flags raised a minute at most, where identities are likeliest to fail; those of 3 minutes are saved."""
    risk: Annotated[float, Field(ge=0, le=1)] = 0.1
    """How likely a failure is at least for which one is raised, as far as the trackers can tell."""
    reasons: list[RiskReason] = ["crossing", "id_switch", "track_loss", "optimality_gap"]
    """For which of the troubles that are foreseen one is raised."""
    answer_s: Annotated[float, Field(gt=0, le=600)] = 8.0
    """Seconds after the expected moment in which a flag can be answered; see `track.assist.memory_frames`."""


class ViewSettings(Section):
    """The best-view service."""

    lookahead: PositiveInt = 25
    """Frames the choice of a view looks ahead: N of the paper's section III; all of it is delay."""
    switch_cost_s: Seconds = 0.3
    """λ: how many seconds of not seeing the person, while another camera does, are worth a cut; of a view
    that is worth half the best one it takes twice as many."""
    extrapolate_s: Seconds = 0.5
    """For how long the views at the end of the look-ahead are taken to go on as they are."""
    presence_decay_s: Seconds = 1.0
    """Who is not found any more is taken to be still there, less and less, for so long; 0: not at all."""
    undetected_weight: Annotated[float, Field(ge=0, le=1)] = 1.0
    """What a view of somebody counts for whom the camera does not find, though they stand before it as others
    know: this share of what it is worth by how surely people show there; 0: nothing."""
    min_shot_s: Annotated[float, Field(ge=0, le=600)] = 0.0
    """A camera is shown for so long at least, in whole GOPs; one that sees nobody may be left sooner."""
    late_after_s: PositiveFloat = 0.5
    """How long to wait for a camera's tracks before going on without that camera."""
    buffer_s: PositiveFloat = 10.0
    """Video kept per camera."""
    quality: Annotated[QualitySettings, no_unknown_keys(QualitySettings)] = QualitySettings()
    """What makes a view good."""
    identity: Annotated[IdentitySettings, no_unknown_keys(IdentitySettings)] = IdentitySettings()
    flags: FlagSettings = FlagSettings()
    """Where a camera's tracker may go wrong, of what `track.assist` foresees."""
    share: ShareSettings = ShareSettings()
    """With other best-view services of the site."""
