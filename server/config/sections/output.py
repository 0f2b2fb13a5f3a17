"""The sections `http` and `record`: serving and recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from server.config.sections.base import Section


class TlsSettings(Section):
    """HTTPS: both files or none."""

    certificate: Path | None = None
    """PEM: the certificate, and after it those that lead to its authority."""
    key: Path | None = None
    """PEM: the private key, without a password."""

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate, key: HTTPS takes both files; one of them is not named")
        return self


_CONNECTIONS_PER_VIEWER = 4
"""A stream, events, and what a browser fetches besides."""
_CONNECTIONS_LEAST = 1000


class HttpSettings(Section):
    """The page, the streams and the API."""

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8080
    viewers_max: PositiveInt = 1000
    """Streams served at once, and as many readers of events; one more gets 503, or another's place."""
    viewers_per_object: PositiveInt = 1000
    """The same of one object, or of one camera."""
    connections_max: PositiveInt | None = None
    """Connections at once; none: four for each of `viewers_max`, and 1000 at least."""
    connections_per_address: PositiveInt | None = None
    """The same of one address, this machine's own excepted; none: half of them."""
    request_timeout_s: PositiveFloat = 10.0
    """Seconds in which what a connection asks for must have come."""
    keepalive_timeout_s: PositiveFloat = 150.0
    """Seconds after which a connection is closed that has nothing more to ask for."""
    viewer_queue_gops: PositiveInt = 8
    """A viewer that falls behind by more loses whole GOPs."""
    hls_segment_s: PositiveFloat = 1.0
    """As many whole GOPs as fit are a segment of HLS, at least one."""
    hls_window_s: PositiveFloat = 6.0
    """Segments that a playlist of HLS lists; twice as many are kept."""
    pictures_max: PositiveInt = 8
    """People and cameras whose pictures are decoded at once: JPEG, and boxes burnt in. One more gets 503."""
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 80
    tls: TlsSettings = TlsSettings()

    @property
    def connections(self) -> int:
        """How many connections are taken at once, where the system lets that many be open."""
        return self.connections_max or max(_CONNECTIONS_LEAST, _CONNECTIONS_PER_VIEWER * self.viewers_max)


class RecordSettings(Section):
    """Recording of the streams to disk."""

    folder: Path | None = None
    """Where; none: nothing is recorded."""
    keep_s: PositiveFloat = 86_400.0
    """Seconds after which it is taken away."""
    trust_clock: bool = False
    """The time that the machine was off counts by its clock also where nobody keeps that right (NTP)."""
    max_mb: PositiveFloat = 10_000.0
    """Megabytes that it takes on the disk at most; the oldest goes first."""
    segment_s: PositiveFloat = 60.0
    """Seconds in a file: only whole files are taken away."""
