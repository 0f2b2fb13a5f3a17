"""Client networks: all addresses that a provider assigns to one customer count as one client."""

from __future__ import annotations

import ipaddress

_IPV6_PREFIX = 64
"""Prefix length that identifies a customer: each is assigned at least such a network (RFC 6177)."""


def is_loopback(address: str) -> bool:
    """Return whether an address is a loopback address."""
    ip = _parse(address)
    return ip is not None and ip.is_loopback


def network_of(address: str) -> str:
    """Return the network of an address: an IPv4 address itself, the /64 network of an IPv6 address."""
    ip = _parse(address)
    if ip is None or ip.version == 4:  # noqa: PLR2004 — it is the version's name
        return address if ip is None else str(ip)
    return str(ipaddress.ip_network((int(ip), _IPV6_PREFIX), strict=False))


def _parse(address: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        ip = ipaddress.ip_address(address)
    except ValueError:
        return None
    return getattr(ip, "ipv4_mapped", None) or ip
