"""Speaking to a MyView server: addresses, errors in one line, how long to wait and how often to try."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import TypeVar

import aiohttp
import msgspec
from yarl import URL

_NOT_FOUND = 404
_CLIENT_ERRORS = range(400, 500)
_ANSWER = TypeVar("_ANSWER")


class ClientError(Exception):
    """The server did not give what was asked for: one line for people."""


class NotFoundError(ClientError):
    """The server does not know it."""


class RefusedError(ClientError):
    """The server refuses the request: asking again will not help."""


class AwayError(ClientError):
    """The server cannot be reached, or not any more."""


class ContractError(ClientError):
    """What answers is not a MyView server, or one of another version."""


@dataclass(frozen=True, slots=True)
class HttpSettings:
    """How patient the client is."""

    connect_timeout: float = 5.0
    """Seconds until a connection must stand."""
    read_timeout: float = 15.0
    """Seconds without a byte until the server is taken for gone."""
    retries: int = 26
    """Attempts in a row that bring nothing until a stream is given up; 0: no second attempt."""
    backoff_first: float = 0.25
    """Seconds before the first further attempt; doubled each time."""
    backoff_most: float = 1.0
    """Seconds between attempts at most: a server that is back is seen again by then."""
    token: str | None = field(default=None, repr=False)
    """What lets in, where the server asks for it."""

    def backoff(self, failures: int) -> float:
        """Give the seconds to wait after so many failures in a row (1 or more)."""
        return min(self.backoff_most, self.backoff_first * 2.0 ** min(failures - 1, 30))


def server_url(text: str) -> URL:
    """Give the server's address from what a user types or pastes: the page's link will do.

    Raises:
        ValueError: it is no HTTP address.
    """
    try:
        url = URL(text if "://" in text else f"http://{text}")
    except ValueError as error:
        raise ValueError(f"{text!r} is not an address: {error}") from error
    if url.scheme not in {"http", "https"} or not url.host:
        raise ValueError(f"{text!r} is not an address like http://host:port")
    return url.with_query(None).with_fragment(None)


@asynccontextmanager
async def get(url: URL, settings: HttpSettings, accept: str) -> AsyncIterator[aiohttp.ClientResponse]:
    """Open an answer for reading; what goes wrong with it inside the block is an AwayError too.

    Raises:
        NotFoundError, RefusedError, AwayError: with the server's own words where it gave some.
    """
    timeout = aiohttp.ClientTimeout(
        total=None, sock_connect=settings.connect_timeout, sock_read=settings.read_timeout
    )
    try:
        async with (
            aiohttp.ClientSession(timeout=timeout) as session,
            session.get(url, headers=_headers(settings, accept)) as answer,
        ):
            await _check(answer)
            yield answer
    except aiohttp.ClientError as error:
        raise AwayError(f"{url.origin()}: {error}") from error
    except TimeoutError as error:
        raise AwayError(f"{url.origin()}: no answer") from error


async def get_json(url: URL, kind: type[_ANSWER], settings: HttpSettings) -> _ANSWER:
    """Get an answer of the interface.

    Raises:
        ClientError: it cannot be had, or is not of that kind.
    """
    async with get(url, settings, "application/json") as answer:
        body = await answer.read()
    try:
        return msgspec.json.decode(body, type=kind)
    except msgspec.DecodeError as error:
        raise ContractError(f"{url} does not answer like MyView: {error}") from error


def _headers(settings: HttpSettings, accept: str) -> dict[str, str]:
    heads = {"Accept": accept}
    return heads if settings.token is None else {**heads, "Authorization": f"Bearer {settings.token}"}


async def _check(answer: aiohttp.ClientResponse) -> None:
    if answer.ok:
        return
    words = _error_text(await answer.read()) or f"{answer.status} {answer.reason}"
    if answer.status == _NOT_FOUND:
        raise NotFoundError(words)
    if answer.status in _CLIENT_ERRORS:
        raise RefusedError(words)
    raise AwayError(f"{answer.url.origin()}: {words}")


class _ErrorBody(msgspec.Struct):
    error: str


def _error_text(body: bytes) -> str | None:
    """Give the first line of the server's own words."""
    try:
        words = msgspec.json.decode(body, type=_ErrorBody).error
    except msgspec.DecodeError:
        return None
    return words.splitlines()[0] if words.strip() else None
