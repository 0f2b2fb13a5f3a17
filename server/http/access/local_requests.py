"""Detection of requests from this machine, which may operate where there are no tokens."""

from __future__ import annotations

import re

from aiohttp import HttpVersion11, web
from yarl import URL

from server.http.access.networks import is_loopback

_PROXY_HEADER = re.compile(
    r"via|cdn-loop|front-end-https|(x-)?(url-)?scheme|x-(proto|ssl|host|varnish|proxied|proxyuser-ip)|x-azure-ref"
    r"|x-(amzn-trace-id|cloud-trace-context)|(x-(envoy|original|appengine|vercel|arr)|cf|wl-proxy)-.*"
    r"|.*forwarded.*|.*(client|real|remote|connecting|user|cluster)-?(ip|addr)"
)
"""Headers that proxies add; each proxy has a different selection."""


def is_local_request(request: web.Request) -> bool:
    """Return whether a request comes from a loopback address, without a proxy, and to a local host name.

    The host name is checked against DNS rebinding: another site's name may resolve to this machine.
    """
    if request.version < HttpVersion11 or any(map(_is_proxy_header, request.headers)):
        return False  # some proxies speak HTTP/1.0; no browser does
    urls = [f"http://{request.host}"]
    urls += [request.headers[name] for name in ("Origin", "Referer") if name in request.headers]
    return is_loopback(request.remote or "") and all(map(_names_this_machine, urls))


def _is_proxy_header(name: str) -> bool:
    """Return whether a header is one that proxies add; some write _ for -."""
    return _PROXY_HEADER.fullmatch(name.lower().replace("_", "-")) is not None


def _names_this_machine(url: str) -> bool:
    try:
        host = URL(url).host or ""
    except ValueError:
        return False
    return host == "localhost" or is_loopback(host)
