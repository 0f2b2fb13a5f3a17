"""The sections `site`, `sync` and `zenoh`: what all processes of a site share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from pydantic import AfterValidator, Field, NonNegativeFloat, PositiveFloat

from server.config.sections.base import Endpoint, Endpoints, Identifier, PictureSide, Port, Section


def _known_time_zone(name: str) -> str:
    try:
        ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise ValueError("is not a time zone that this machine knows, such as Europe/Zurich") from None
    return name


class SiteSettings(Section):
    """Picture size and frame rate of the streams: every camera's picture is scaled to this size."""

    name: Identifier = "site"
    fps: Annotated[float, Field(ge=0.001, le=1000, allow_inf_nan=False)] = 25.0
    width: PictureSide = 640
    height: PictureSide = 360
    niceness: Annotated[int, Field(ge=0, le=19)] = 10
    """Niceness added to camera processes (nice(1)): a busy machine serves streams first."""
    time_zone: Annotated[str, AfterValidator(_known_time_zone)] | None = None
    """Of the hours of `rules`, such as Europe/Zurich; None: the machine's."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of every camera's picture in the streams, pixels."""
        return self.width, self.height


class ProcessTlsSettings(Section):
    """TLS between the processes of a site; clients have no certificate."""

    authority: Path | None = None
    """PEM: the authority that has signed the server's certificate; clients trust it alone."""
    certificate: Path | None = None
    """PEM: the server's certificate; it names the host at which clients connect."""
    key: Path | None = None
    """PEM: its private key."""


class SyncSettings(Section):
    """The pulse server."""

    host: str = "127.0.0.1"
    """Where cameras find the server."""
    bind: str = "127.0.0.1"
    """The address the server listens on."""
    port: Port = 7400
    users: Path | None = None
    """A file of `name:password`, one a line; none: no login, every client gets the pulses.

    A camera logs in as its id, services as bestview, bestview-1, … The server needs all lines, each client
    its own. Needs `tls` except on the loopback interface.
    """
    tls: ProcessTlsSettings = ProcessTlsSettings()
    """Encryption of the pulses: `certificate` and `key` on the server, `authority` on its clients."""
    start_timeout_s: NonNegativeFloat = 20.0
    """How long pulse 0 waits for all cameras to be there, so that recordings start at their first frame."""


class ZenohSettings(Section):
    """The message bus. Every best-view service is a router: no separate daemon is needed."""

    connect: Endpoints = "tcp/127.0.0.1:7447"
    """Where cameras find the routers, one for each best-view service: they connect to all of them."""
    listen: Endpoint = "tcp/127.0.0.1:7447"
    """Where this best-view service's router listens."""
    lease_s: PositiveFloat = 1.0
    """Seconds of silence after which a process counts as gone."""
    users: Path | None = None
    """A file of `name:password`, one a line; none: no login.

    A camera logs in as its id, and may publish only its own keys. The router needs all lines, others
    their own.
    """
    tls: ProcessTlsSettings = ProcessTlsSettings()
    """Encryption of the bus, where its addresses begin with tls/."""

    @property
    def routers(self) -> tuple[str, ...]:
        """The endpoints of all routers."""
        return tuple(self.connect.split(","))
