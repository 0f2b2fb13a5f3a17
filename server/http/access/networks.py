"""Whose an address is: what one customer of a provider has counts as one."""

from __future__ import annotations

import ipaddress

_CUSTOMER = 64
"""Bits of an IPv6 address that a network is told apart by: of the others each host has all (RFC 6177)."""


def is_loopback(address: str) -> bool:
    """Tell whether an address is this machine's own."""
    ip = _parsed(address)
    return ip is not None and ip.is_loopback


def network_of(address: str) -> str:
    """Return what is counted as one address: of IPv6 a whole network, which one host may have all of."""
    ip = _parsed(address)
    if ip is None or ip.version == 4:  # noqa: PLR2004 — it is the version's name
        return address if ip is None else str(ip)
    return str(ipaddress.ip_network((int(ip), _CUSTOMER), strict=False))


def _parsed(address: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        ip = ipaddress.ip_address(address)
    except ValueError:
        return None
    return getattr(ip, "ipv4_mapped", None) or ip
