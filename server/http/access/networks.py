"""Client networks: the addresses that one customer of a provider has count as one."""

from __future__ import annotations

import ipaddress

_IPV6_PREFIX = 64
"""Bits of an IPv6 address that tell customers apart; each has all addresses of such a network (RFC 6177)."""


def is_loopback(address: str) -> bool:
    """Return whether an address is this machine's own."""
    ip = _parse(address)
    return ip is not None and ip.is_loopback


def network_of(address: str) -> str:
    """Return what an address counts as: an IPv4 address itself, an IPv6 address its /64 network."""
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
