"""Exposure checks: refuse a site that other machines can reach without authentication."""

from __future__ import annotations

import ipaddress
import re
from urllib.parse import urlsplit

from server.config.site_config import Config
from server.config.tokens_file import read_tokens
from server.system.address_redaction import redact_zenoh_endpoint
from server.system.errors import UserError

_AUTHORITY = re.compile(r"[a-z]+/(?P<host>[^\s?#]+):[0-9]+")


def check_viewers(config: Config) -> None:
    """Refuse to serve other machines without tokens, unless `access.open_to_all` is set.

    Raises:
        UserError: `http.host` is not a loopback address; or the token file cannot be read.
    """
    if config.access.tokens is not None:
        read_tokens(config.access.tokens)
    elif not (is_local_host(config.http.host) or config.access.open_to_all):
        raise UserError(
            f"http.host: {config.http.host} lets other machines watch, and there are no tokens: "
            "set access.tokens to a file of them (`myview token NAME` makes a line), or "
            "access.open_to_all: true"
        )


def check_rtsp(config: Config) -> None:
    """Refuse to give streams to other machines by RTSP without tokens, unless `access.open_to_all` is set.

    A gateway whose service is on another machine has that service's access rules.

    Raises:
        UserError: `rtsp.host` is not a loopback address.
    """
    rtsp, access = config.rtsp, config.access
    if is_local_host(rtsp.host) or access.tokens is not None or access.open_to_all:
        return
    if rtsp.service is not None and not is_local_host(urlsplit(rtsp.service).hostname or ""):
        return
    raise UserError(
        f"rtsp.host: {rtsp.host} lets other machines watch, and there are no tokens: set access.tokens to "
        "a file of them (`myview token NAME` makes a line), or access.open_to_all: true"
    )


def check_pulses(config: Config) -> None:
    """Refuse to send pulses to other machines, unless they log in over TLS, or the network is trusted.

    Raises:
        UserError: `sync.bind` is not a loopback address.
    """
    sync = config.sync
    if (sync.users is None or sync.tls.key is None) and not is_local_host(sync.bind):
        exposure = f"sync.bind: {sync.bind} lets other machines listen to the pulses"
        _check_network(config, exposure, "set sync.users and sync.tls")


def check_bus(config: Config) -> None:
    """Refuse to be a bus router for other machines, unless it has users and TLS or trusts the network.

    Raises:
        UserError: `zenoh.listen` is not a loopback address.
    """
    zenoh = config.zenoh
    if zenoh.users is not None and zenoh.listen.startswith("tls/"):
        return
    match = _AUTHORITY.match(zenoh.listen)
    if match is None or not is_local_host(match["host"].strip("[]")):
        exposure = (
            f"zenoh.listen: {redact_zenoh_endpoint(zenoh.listen)} lets other machines send frames and tracks"
        )
        _check_network(config, exposure, "use tls/ and set zenoh.users")


def is_local_host(host: str) -> bool:
    """Return whether a host is only reachable from this machine."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _check_network(config: Config, exposure: str, remedy: str) -> None:
    if not config.access.trusted_network:
        raise UserError(
            f"{exposure} without authentication: bind it to 127.0.0.1, {remedy}, or, on a trusted "
            "network, set access.trusted_network: true"
        )
