"""Other sites: who is there, as far as a viewer may know."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from server.service.facade.people import PersonElsewhere
from server.service.other_sites.people_publisher import Tokens
from server.service.pipeline import BestViewPipeline


@dataclass(frozen=True, slots=True)
class SiteLink:
    """The link with another site."""

    name: str
    is_there: bool
    """Whether it has been heard lately."""


class SitesService:
    """Queries about other sites. A viewer's token is given by its SHA-256; None: they have none."""

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._sites, self._decisions = pipeline.other_sites, pipeline.decision_state

    def list_elsewhere(self, token_sha256: str | None) -> list[PersonElsewhere]:
        """Return whom other sites have seen last, by number, if they accept a viewer; nobody visible here."""
        found = []
        for sighting in self._sites.whereabouts():
            site = self._sites.sites[sighting.site]
            may_know = site.may_know(token_sha256, sighting.number)
            if may_know and not self._decisions.is_visible(sighting.number):
                found.append(
                    PersonElsewhere(
                        sighting.number,
                        site.settings.base_url,
                        site.name,
                        visible=sighting.stay_s is not None,
                        token=not site.viewers.is_open,
                    )
                )
        return found

    def find(self, number: int, token_sha256: str | None) -> PersonElsewhere | None:
        """Return where a person was seen last; None: here, nowhere, or the viewer may not know."""
        people = self.list_elsewhere(token_sha256) if self._sites.sites else []
        return next((person for person in people if person.object == number), None)

    def audience(self, token_sha256: str | None) -> str | None:
        """Return what distinguishes a viewer from others, as to what they may know of other sites."""
        return token_sha256 if self._sites.sites else None

    def accept_tokens(self, tokens: Callable[[], Tokens | None]) -> None:
        """Set who may know who is here: whose tokens, by SHA-256, are returned; None: everybody."""
        self._sites.publisher.accepted_tokens = tokens

    def links(self) -> list[SiteLink]:
        """Return the links with all other sites."""
        now = self._sites.now
        return [SiteLink(name, site.is_there(now)) for name, site in sorted(self._sites.sites.items())]
