"""The section `sites`: other sites, whose people may come here."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, PositiveInt, model_validator

from bestview import IdSeries
from server.config.sections.base import IDENTIFIER, Endpoints, Identifier, PageUrl, Section
from server.config.sections.site import ProcessTlsSettings, ZenohSettings

SITES_MAX = 1000
"""Linked sites, at most."""


class LinkSettings(Section):
    """Another site: its people are received from its routers."""

    connect: Endpoints
    """Where its routers listen, as in its `zenoh`."""
    url: PageUrl
    """Base URL of its page, to which viewers of its people are sent."""
    users: Path | None = None
    """A file with a line `site-NAME:password`, NAME being this site, that its `zenoh.users` has, too; such a
    user receives nothing else. None: no login."""
    authority: Path | None = None
    """PEM: the authority that has signed its routers' certificates."""

    def bus(self, lease_s: float) -> ZenohSettings:
        """Return the settings of a session to its routers."""
        return ZenohSettings(
            connect=self.connect,
            users=self.users,
            tls=ProcessTlsSettings(authority=self.authority),
            lease_s=lease_s,
        )

    @property
    def base_url(self) -> str:
        """The URL, with a slash at the end."""
        return self.url.rstrip("/") + "/"


class SitesSettings(Section):
    """Sites whose people keep their numbers when they walk from one into another."""

    of: Annotated[int, Field(ge=1, le=SITES_MAX)] = 1
    """How many sites there may be; the same in all of them. Each assigns every `of`th person number."""
    index: Annotated[int, Field(ge=0, lt=SITES_MAX)] = 0
    """This site's, from 0; each has its own."""
    link: dict[Identifier, LinkSettings] = {}
    """The other sites, by `site.name`."""
    share_looks: bool = True
    """Tell the others how people look; false: nobody who leaves for them keeps their number."""
    people_max: PositiveInt = 500
    """People of other sites remembered at most, those seen last."""

    @property
    def ids(self) -> IdSeries:
        """The person numbers that this site assigns."""
        return IdSeries(self.index, self.of)

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.index >= self.of:
            raise ValueError(f"index: is {self.index}, but of {self.of} sites the last is {self.of - 1}")
        if len(self.link) >= self.of:
            raise ValueError(
                f"of: is {self.of}, but with those of link there are {len(self.link) + 1} sites: set of to "
                "that or more, the same in all of them"
            )
        return self


def site_user(name: str) -> str:
    """Return the name by which a site logs in to another one's bus."""
    return f"{SITE_USER_PREFIX}{name}"


SITE_USER_PREFIX = "site-"
_SITE_USER = re.compile(SITE_USER_PREFIX + IDENTIFIER)


def is_site_user(user: str) -> bool:
    """Return whether a user of the bus is another site."""
    return _SITE_USER.fullmatch(user) is not None
