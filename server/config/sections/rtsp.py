"""The section `rtsp`: the gateway that gives the streams to RTSP clients."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from server.config.sections.base import Port, Section, matching
from server.config.sections.output import TlsSettings


class RtspSettings(Section):
    """The RTSP gateway, a process of its own on GStreamer's RTSP server."""

    enabled: bool = False
    """Whether `myview up` runs it."""
    host: str = "127.0.0.1"
    port: Port = 8554
    clients_max: Annotated[int, Field(ge=1, le=1000)] = 32
    """Connections with a stream; one more gets 503."""
    udp: bool = True
    """Whether clients may ask for UDP; otherwise all is sent over their TCP connection."""
    tls: TlsSettings = TlsSettings()
    """RTSP over TLS (rtsps://): both files or none."""
    service: (
        Annotated[str, matching(r"https?://[^\s/?#@]+/?", "is not an address such as http://127.0.0.1:8080/")]
        | None
    ) = None
    """Address of the best-view service; none: this machine's, as in `http`."""
    certificate: Path | None = None
    """PEM: the service's certificate, if it has HTTPS; none: that of `http.tls`."""
    python: str = "/usr/bin/python3"
    """The Python that has GStreamer's RTSP server: the system's."""
