"""Whether a request comes from this machine, which may operate where there are no tokens."""

from __future__ import annotations

import re

from aiohttp import HttpVersion11, web
from yarl import URL

from server.http.access.networks import is_loopback

_FROM_A_PROXY = re.compile(
    r"via|cdn-loop|front-end-https|(x-)?(url-)?scheme|x-(proto|ssl|host|varnish|proxied|proxyuser-ip)|x-azure-ref"
    r"|x-(amzn-trace-id|cloud-trace-context)|(x-(envoy|original|appengine|vercel|arr)|cf|wl-proxy)-.*"
    r"|.*forwarded.*|.*(client|real|remote|connecting|user|cluster)-?(ip|addr)"
)
"""Heads by which proxies say that they are there. Each sends some of them, and hardly two the same ones."""


def is_from_here(request: web.Request) -> bool:
    """Tell whether a request comes from this machine: by its address, by no proxy, and by a name of it.

    The name is looked at since a page's own name can be made to lead here (DNS rebinding).
    """
    if request.version < HttpVersion11 or any(map(_is_of_a_proxy, request.headers)):
        return False  # HTTP/1.0 is what some proxies speak; no browser does
    named = [f"http://{request.host}"]
    named += [request.headers[it] for it in ("Origin", "Referer") if it in request.headers]
    return is_loopback(request.remote or "") and all(_names_this_machine(it) for it in named)


def _is_of_a_proxy(head: str) -> bool:
    """Tell whether a head is one that proxies add; some write _ for -."""
    return _FROM_A_PROXY.fullmatch(head.lower().replace("_", "-")) is not None


def _names_this_machine(address: str) -> bool:
    try:
        host = URL(address).host or ""
    except ValueError:
        return False
    return host == "localhost" or is_loopback(host)
