"""Target for a site with access tokens: only a valid token grants access, and only to its scope.

The expected result is derived from an input's bytes, not from the server: the secrets in it, and the address
that the application matched. Object 1 is in view of camera c0 only, object 2 of c1.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from random import Random
from urllib.parse import unquote_to_bytes

import yaml
from aiohttp import web

from benchmarks.fuzz.engine.fed_site import STRIDE, make_separate_tracks, pictures
from benchmarks.fuzz.engine.mutations import as_json, mutate_bytes
from benchmarks.fuzz.engine.target import Target, folder
from benchmarks.fuzz.http.addresses import WORDS, address, some_range
from benchmarks.fuzz.http.served_site import EPOCHS, ServedSite, check_response
from server.config.tokens_file import secret_digest
from server.http.access.authorization import ACCESS
from server.http.access.sessions import _Session
from server.http.app_keys import SERVICE

_TOKEN_NAMES = ("hall", "family", "door", "night", "void")
SECRETS = {who: f"{who}-{Random(who).randbytes(24).hex()}" for who in _TOKEN_NAMES}
_COOKIES = {who: f"{who}+{Random(who + who).randbytes(24).hex()}" for who in _TOKEN_NAMES}
_RIGHTS: dict[str, dict[str, object]] = {
    "hall": {"role": "watch"},
    "family": {"role": "watch", "object": 1, "made": "2999-01-01T00:00:00Z"},
    "door": {"role": "watch", "camera": "c0"},
    "night": {"role": "operate"},
    "void": {"role": "watch", "object": 1, "made": "2001-01-01T00:00:00Z"},
}
_NAMES = {1: "Ada Lovelace", 2: "Charles Babbage"}
_OPEN = {"/", "/operator", "/page/{file}", "/api", "/api/openapi.json", "/healthz", "/readyz", "/api/session"}
_NARROW = {
    "/api/site",
    "/api/objects",
    "/api/cameras",
    "/api/events",
    "/api/flags",
    "/api/past",
    "/api/past/search",
}
"""Addresses that accept every token, and limit the content to its scope."""
_ADDRESSES = ("127.0.0.1", "127.0.0.1", "127.0.0.1", "127.0.0.1", "127.0.0.2", "127.0.0.9")
"""Client addresses; the last one is blocked after too many wrong tokens."""
_WINDOW = 24
_RENDERED = (".mjpeg", "best.jpg", "live.jpg")
"""Addresses that start a render worker."""


@dataclass(frozen=True, slots=True)
class _AnsweredRequest:
    """The request that a response belongs to."""

    status: int
    method: str
    path: str
    """The pattern of the address."""
    object: int | None
    """The requested person, by their current number."""
    camera: str | None
    held: bool
    """Whether the view is fixed to a camera."""


class UnauthenticatedRequests(Target):
    """Target for requests with and without tokens, which must only reveal what the token grants."""

    name = "http-unauthenticated"

    def __init__(self) -> None:
        self._folder = folder()
        tokens = Path(self._folder.name) / "tokens.yaml"
        listed: list[dict[str, object]] = [
            {"name": f"token {who}", "sha256": secret_digest(SECRETS[who]), **rights}
            for who, rights in _RIGHTS.items()
        ]
        tokens.write_text(yaml.safe_dump({"tokens": listed}))
        self._answered: list[_AnsweredRequest] = []
        self._served = ServedSite(
            {"access": {"tokens": str(tokens)}, "http": {"hls_segment_s": 0.2}},
            make_separate_tracks,
            before=self._watch,
        )
        for number, name in _NAMES.items():
            self._served.service.decider.people.registry.set_name(number, name)
        self._authenticator = self._served.app[ACCESS].authenticator
        ends = time.monotonic() + 1e9
        self._sessions = {
            secret_digest(_COOKIES[who]): _Session(secret_digest(SECRETS[who]), ends) for who in _TOKEN_NAMES
        }
        self._paths = [
            address for address in self._served.documented_addresses if not address[0].endswith(_RENDERED)
        ]
        self._pictures = {
            "c0": _windows(0, 0.5) - _windows(1, 0.0),
            "c1": _windows(1, 0.5) - _windows(0, 0.0),
        }

    def _watch(self, app: web.Application) -> None:
        """Record the request of every response."""
        app.on_response_prepare.append(self._record)

    async def _record(self, request: web.Request, response: web.StreamResponse) -> None:
        resource, names = request.match_info.route.resource, request.match_info
        number = (
            request.app[SERVICE].people.current_number(int(names["object"])) if "object" in names else None
        )
        self._answered.append(
            _AnsweredRequest(
                status=response.status,
                method=request.method,
                path="" if resource is None else resource.canonical,
                object=number,
                camera=names.get("camera"),
                held="camera" in request.query,
            )
        )

    def make(self, rng: Random) -> bytes:
        """Return the client address and the bytes of a request."""
        path, queries = rng.choice(self._paths)
        url = address(rng, path, queries)
        lines = ["Host: 127.0.0.1"]
        for _ in range(rng.choice((0, 1, 1, 1, 1, 2))):
            who = rng.choice(_TOKEN_NAMES)
            kind = rng.random()
            if kind < 0.35:
                scheme = rng.choice(("Bearer", "Bearer", "bearer", "BEARER ", "Basic", ""))
                lines.append(f"Authorization: {scheme} {_nearly(rng, SECRETS[who])}")
            elif kind < 0.7:
                url += f"{'&' if '?' in url else '?'}token={_nearly(rng, SECRETS[who])}"
            else:
                name = rng.choice(("myview_hall_0",) * 4 + ("myview", "MYVIEW_HALL_0"))
                other_cookies = rng.choice(("", "a=b; ", "=; "))
                lines.append(f"Cookie: {other_cookies}{name}={_nearly(rng, _COOKIES[who])}")
        if rng.random() < 0.05:
            lines.append(rng.choice(("X-Forwarded-For: 127.0.0.1", "Origin: http://x", some_range(rng))))
        method, body = rng.choice(("GET",) * 12 + ("HEAD", "OPTIONS", "POST", "DELETE")), b""
        if method == "POST":
            url, body = (
                "/api/session",
                as_json({"token": _nearly(rng, SECRETS[rng.choice(_TOKEN_NAMES)])}),
            )
            lines += ["X-MyView-Changes: 1", f"Content-Length: {len(body)}"]
        elif method == "DELETE":
            url = "/api/session"
            lines.append("X-MyView-Changes: 1")
        head = "\r\n".join([f"{method} {url} HTTP/1.1", *lines, "Connection: close", "", ""])
        request = head.encode("utf-8", "surrogateescape") + body
        request = mutate_bytes(rng, request, WORDS) if rng.random() < 0.25 else request
        return bytes([rng.randrange(len(_ADDRESSES))]) + request

    def feed(self, data: bytes) -> bool:
        """Send the request, and check that the response reveals only what is granted."""
        came_from = _ADDRESSES[data[0] % len(_ADDRESSES)] if data else _ADDRESSES[0]
        self._authenticator.sessions._sessions = dict(self._sessions)
        self._authenticator._rate_limit._until = {_ADDRESSES[-1]: time.monotonic() + 1e9}
        self._authenticator._valid.clear()
        self._answered.clear()
        answer = self._served.send(data[1:], came_from)
        granted = check_response(data[1:], answer)
        text = data + unquote_to_bytes(data)
        holders = {
            name for name in _TOKEN_NAMES if SECRETS[name].encode() in text or _COOKIES[name].encode() in text
        }
        for answered in self._answered:
            refused = answered.status >= HTTPStatus.BAD_REQUEST
            assert refused or _may_get(holders, answered), f"{sorted(holders)}: {answered}"
        if not holders & {"hall", "night"}:
            self._check_content(holders, answer)
        return granted

    def _check_content(self, holders: set[str], answer: bytes) -> None:
        pieces = {answer[at : at + _WINDOW] for at in range(0, len(answer) - _WINDOW, _WINDOW)}
        for camera, pictures_of_camera in self._pictures.items():
            allowed = camera == "c0" and holders & {"family", "door"}
            assert allowed or pictures_of_camera.isdisjoint(pieces), (
                f"{sorted(holders)}: a picture of {camera}"
            )
        for number, name in _NAMES.items():
            assert name.encode() not in answer or (number == 1 and "family" in holders), (
                f"{sorted(holders)}: {name}"
            )

    def close(self) -> None:
        """Stop the server."""
        self._served.close()
        self._folder.cleanup()


def _may_get(holders: set[str], answered: _AnsweredRequest) -> bool:
    """Return whether a client with these secrets may get this response."""
    if answered.path in _OPEN or answered.method == "OPTIONS" or "night" in holders:
        return True
    if "hall" in holders:
        return not answered.path.startswith("/api/operator")
    if answered.path in _NARROW:
        return bool(holders & {"family", "door"})
    if answered.object is not None:
        return "family" in holders and answered.object == 1 and not answered.held
    return answered.camera == "c0" and "door" in holders


def _nearly(rng: Random, secret: str) -> str:
    """Return a secret, sometimes damaged."""
    if rng.random() < 0.5:
        return secret
    if rng.random() < 0.2:
        return secret_digest(secret)
    damaged = mutate_bytes(rng, secret.encode()).decode("utf-8", "surrogateescape")
    return damaged.replace("\r", "").replace("\n", "") if rng.random() < 0.8 else damaged


def _windows(seed: int, begin: float) -> frozenset[bytes]:
    """Return pieces of all pictures of a camera, each from a share of its length on."""
    found: set[bytes] = set()
    for unit in pictures(seed, EPOCHS * STRIDE):
        begins = range(round(begin * len(unit.data)), len(unit.data) - _WINDOW)
        found.update(unit.data[at : at + _WINDOW] for at in begins)
    return frozenset(found)
