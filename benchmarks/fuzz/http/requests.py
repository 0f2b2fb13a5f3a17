"""Target for requests by the OpenAPI description, and raw bytes, to a site without access control."""

from __future__ import annotations

from random import Random

from benchmarks.fuzz.engine.mutations import as_json, mutate_bytes, mutate_value
from benchmarks.fuzz.http.addresses import METHODS, WORDS, address, some_range
from benchmarks.fuzz.http.served_site import OpenSiteTarget
from server.http.access.csrf import CSRF_HEADER

_CSRF_SHARE = 0.8
_BODIES = (
    {"object": 1, "name": "Ada"},
    {"object": 1, "merge": 2},
    {"object": 1, "split": ["c0"]},
    {"switch_cost_s": 0.2, "quality.relative": True},
    {"token": "secret"},
    {"boxes": [[1.0, 2.0, 3.0, 4.0]]},
)
_RENDERING = (".mjpeg", ".jpg", "/stills", "overlay")
"""Addresses that start a render worker, which is a hundred times slower."""
_HEADERS = (
    "Range: bytes=0-",
    "Accept-Encoding: gzip, \x01",
    "Origin: http://elsewhere",
    "If-None-Match: *",
    "Authorization: Bearer é",
    "Authorization: Basic Zm9v",
    "Cookie: myview=x; a",
    "Expect: 200-ok",
    "Upgrade: websocket",
    "X-Forwarded-Proto: https",
    "Content-Encoding: gzip",
    "Transfer-Encoding: gzip",
)


class AnonymousRequests(OpenSiteTarget):
    """One request on its own connection."""

    name = "http-requests"

    def __init__(self) -> None:
        super().__init__()
        self._paths = self._served.documented_addresses

    def make(self, rng: Random) -> bytes:
        """Return the bytes of a request."""
        path, queries = rng.choice(self._paths)
        if path.endswith(_RENDERING) and rng.random() < 0.999:
            path, queries = "/api/objects", ()
        url = address(rng, path, queries)
        method = rng.choice(METHODS)
        body = b""
        if method in {"POST", "PUT", "PATCH"}:
            body = as_json(mutate_value(rng, rng.choice(_BODIES)))
            body = mutate_bytes(rng, body) if rng.random() < 0.2 else body
        lines = [f"{method} {url} HTTP/1.1", "Host: 127.0.0.1"]
        if rng.random() < 0.1:
            lines.append(rng.choice(_HEADERS) if rng.random() < 0.7 else some_range(rng))
        if rng.random() < _CSRF_SHARE:
            lines.append(f"{CSRF_HEADER}: 1")  # else it is refused before its body is read
        if body:
            lines += [f"Content-Length: {len(body)}", "Content-Type: application/json"]
        request = "\r\n".join([*lines, "Connection: close", "", ""]).encode("utf-8", "replace") + body
        return mutate_bytes(rng, request, WORDS) if rng.random() < 0.3 else request
