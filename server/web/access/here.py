"""Whether a request comes from this machine, which may operate where there are no tokens."""

from __future__ import annotations

import ipaddress

from aiohttp import HttpVersion11, web
from yarl import URL

_PROXIES = ("Forwarded", "Via", "X-Forwarded-For", "X-Forwarded-Host", "X-Real-IP")


def is_from_here(request: web.Request) -> bool:
    """Tell whether a request comes from this machine: by its address, by no proxy, and by a name of it.

    The name is looked at since a page's own name can be made to lead here (DNS rebinding).
    """
    if request.version < HttpVersion11 or any(it in request.headers for it in _PROXIES):
        return False  # HTTP/1.0 is what some proxies speak; no browser does
    named = [f"http://{request.host}"]
    named += [request.headers[it] for it in ("Origin", "Referer") if it in request.headers]
    return _is_loopback(request.remote or "") and all(_names_this_machine(it) for it in named)


def _names_this_machine(address: str) -> bool:
    try:
        host = URL(address).host or ""
    except ValueError:
        return False
    return host == "localhost" or _is_loopback(host)


def _is_loopback(address: str) -> bool:
    try:
        ip = ipaddress.ip_address(address)
    except ValueError:
        return False
    mapped = getattr(ip, "ipv4_mapped", None)
    return (mapped or ip).is_loopback
