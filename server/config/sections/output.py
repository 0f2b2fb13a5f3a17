"""The sections `http` and `record`: serving and recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from server.config.sections.base import PageUrl, Section


class TlsSettings(Section):
    """HTTPS: both files or none."""

    certificate: Path | None = None
    """PEM: the certificate, and after it those that lead to its authority."""
    key: Path | None = None
    """PEM: the private key, without a password."""

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate, key: HTTPS needs both files; one is missing")
        return self


_CONNECTIONS_PER_VIEWER = 4
"""A stream, events, and what a browser fetches besides."""
_CONNECTIONS_LEAST = 1000


class HttpSettings(Section):
    """The page, the streams and the API."""

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8080
    public_url: PageUrl | None = None
    """Address at which others reach the page: links of webhooks and MQTT begin with it."""
    viewers_max: PositiveInt = 1000
    """Streams served at once, and as many event listeners; one more gets 503, or another viewer's slot."""
    viewers_per_object: PositiveInt = 1000
    """The same of one object, or of one camera."""
    connections_max: PositiveInt | None = None
    """Connections at once; none: four for each of `viewers_max`, and 1000 at least."""
    connections_per_address: PositiveInt | None = None
    """The same of one address, this machine's own excepted; none: half of them."""
    request_timeout_s: PositiveFloat = 10.0
    """Seconds in which a connection's request must be complete."""
    keepalive_timeout_s: PositiveFloat = 150.0
    """Seconds after which an idle connection is closed."""
    viewer_queue_gops: PositiveInt = 8
    """A viewer that falls behind by more loses whole GOPs."""
    hls_segment_s: PositiveFloat = 1.0
    """Length of an HLS segment: as many whole GOPs as fit, at least one."""
    hls_window_s: PositiveFloat = 6.0
    """Length of an HLS playlist; twice as much is kept."""
    pictures_max: PositiveInt = 8
    """Streams rendered at once (JPEG, burnt-in boxes), one per person or camera; one more gets 503."""
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 80
    tls: TlsSettings = TlsSettings()

    @property
    def connections(self) -> int:
        """Connections accepted at once, if the limit of open files allows it."""
        return self.connections_max or max(_CONNECTIONS_LEAST, _CONNECTIONS_PER_VIEWER * self.viewers_max)


class RecordSettings(Section):
    """Recording of the streams to disk."""

    folder: Path | None = None
    """Where; none: nothing is recorded."""
    keep_s: PositiveFloat = 86_400.0
    """Seconds after which recordings are deleted."""
    trust_clock: bool = False
    """Recordings age by the clock while the machine is off, even if NTP does not synchronize it."""
    max_mb: PositiveFloat = 10_000.0
    """Megabytes on the disk at most; the oldest segments are deleted first."""
    segment_s: PositiveFloat = 60.0
    """Seconds in a file: only whole files are deleted."""
