"""Requests to a MyView server: addresses, timeouts, retries, and errors in one line."""

from __future__ import annotations

import asyncio
import os
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import TypeVar

import aiohttp
import msgspec
from yarl import URL

from expbackoff import Backoff

MAX_BODY = 64_000_000
"""Bytes of an answer that is read as a whole; all objects of a large site take some millions."""
_MAX_WORDS = 64_000
"""Bytes of an error response."""
_MAX_SHOWN = 300
"""Characters of a library's message."""
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
    answer_timeout: float = 60.0
    """Seconds until an answer must have begun; and until one that is read as a whole must be there."""
    retries: int = 26
    """Attempts in a row that bring nothing until a stream is given up; 0: no second attempt."""
    backoff_first: float = 0.25
    """Seconds before the first further attempt; doubled each time."""
    backoff_most: float = 1.0
    """Seconds between attempts at most: a server that is back is seen again by then."""
    token: str | None = field(default=None, repr=False)
    """What lets in, where the server asks for it."""

    def backoff(self) -> Backoff:
        """Return the delays between attempts at one thing."""
        return Backoff(self.backoff_first, self.backoff_most)


def server_url(text: str) -> URL:
    """Return the server's address from what a user types or pastes: the page's link will do.

    Raises:
        ValueError: it is no HTTP address.
    """
    # What was typed is not repeated: there may be a token or a password in it.
    typed = text if "://" in text else f"http://{text}"
    _, *beyond = re.split("[/?#]", typed.partition("://")[2])
    if any("@" in part for part in beyond):  # what looks like the host may be the login's beginning
        raise ValueError(
            "the address has an @ behind its host: in a name or password / ? # and @ are %2F %3F %23 and %40"
        )
    try:
        url = URL(typed)
    except ValueError:
        url = URL()
    if url.scheme not in {"http", "https"} or not url.host:
        raise ValueError("what is given is not an address like http://host:port")
    return url.with_query(None).with_fragment(None)


@asynccontextmanager
async def get(url: URL, settings: HttpSettings, accept: str) -> AsyncIterator[aiohttp.ClientResponse]:
    """Open an answer for reading; what goes wrong with it inside the block is an AwayError too.

    Raises:
        NotFoundError, RefusedError, AwayError: with the server's own words where it gave some.
    """
    async with get_any(url, settings, accept) as answer:
        await _check(answer, settings)
        yield answer


@asynccontextmanager
async def get_any(url: URL, settings: HttpSettings, accept: str) -> AsyncIterator[aiohttp.ClientResponse]:
    """Open an answer for reading, a refusal too.

    Raises:
        AwayError: there is none, or something goes wrong with it inside the block.
    """
    timeout = aiohttp.ClientTimeout(
        total=None, sock_connect=settings.connect_timeout, sock_read=settings.read_timeout
    )
    try:
        async with aiohttp.ClientSession(timeout=timeout) as session:
            async with asyncio.timeout(settings.answer_timeout):
                opening = await session.get(url, headers=_headers(settings, accept))
            async with opening as answer:
                yield answer
    except aiohttp.TooManyRedirects as error:
        raise AwayError(f"{url.origin()}: leads on and on, and nowhere") from error
    except aiohttp.ClientError as error:
        raise AwayError(f"{url.origin()}: {_why_away(error)}") from error
    except TimeoutError as error:
        raise AwayError(f"{url.origin()}: no answer") from error


async def get_body(url: URL, settings: HttpSettings, accept: str) -> bytes:
    """Get an answer as a whole.

    Raises:
        ClientError: it cannot be had, or is larger than MAX_BODY.
    """
    async with get(url, settings, accept) as answer:
        return await read_body(answer, settings)


async def read_body(answer: aiohttp.ClientResponse, settings: HttpSettings, most: int = MAX_BODY) -> bytes:
    """Read an answer as a whole.

    Raises:
        ContractError: it is larger than ``most`` bytes.
        TimeoutError: it takes longer than ``settings.answer_timeout``.
    """
    body = bytearray()
    async with asyncio.timeout(settings.answer_timeout):
        async for data in answer.content.iter_any():
            body += data
            if len(body) > most:
                raise ContractError(f"{answer.url.origin()}: the answer is larger than {most} bytes")
    return bytes(body)


async def read_lines(answer: aiohttp.ClientResponse, most: int) -> AsyncIterator[bytes]:
    """Read an answer line by line, without the line ends; what is no whole line at its end is dropped.

    Raises:
        ContractError: a line is larger than ``most`` bytes.
    """
    rest = bytearray()
    async for data in answer.content.iter_any():
        *lines, last = data.split(b"\n")
        for line in lines:
            yield bytes(rest + line)
            rest.clear()
        rest += last
        if len(rest) > most:
            raise ContractError(f"{answer.url.origin()}: a line of the answer is larger than {most} bytes")


async def get_json(url: URL, kind: type[_ANSWER], settings: HttpSettings) -> _ANSWER:
    """Get an answer of the interface.

    Raises:
        ClientError: it cannot be had, or is not of that kind.
    """
    body = await get_body(url, settings, "application/json")
    try:
        return decoded(body, kind)
    except ValueError as error:
        raise ContractError(f"{url.origin()} does not answer like MyView: {error}") from error


def decoded(text: bytes | str, kind: type[_ANSWER]) -> _ANSWER:
    """Read JSON.

    Raises:
        ValueError: it is none, or not of that kind.
    """
    try:
        return msgspec.json.decode(text, type=kind)
    except RecursionError as error:
        raise ValueError("it is nested beyond all measure") from error


def _headers(settings: HttpSettings, accept: str) -> dict[str, str]:
    heads = {"Accept": accept}
    return heads if settings.token is None else {**heads, "Authorization": f"Bearer {settings.token}"}


async def _check(answer: aiohttp.ClientResponse, settings: HttpSettings) -> None:
    if answer.ok:
        return
    try:
        words = _error_text(await read_body(answer, settings, _MAX_WORDS))
    except ContractError:
        words = None
    words = words or f"{answer.status} {answer.reason}"
    if answer.status == _NOT_FOUND:
        raise NotFoundError(words)
    if answer.status in _CLIENT_ERRORS:
        raise RefusedError(words)
    raise AwayError(f"{answer.url.origin()}: {words}")


class _ErrorBody(msgspec.Struct):
    error: str


def _error_text(body: bytes) -> str | None:
    """Return the first line of the server's own words."""
    try:
        words = decoded(body, _ErrorBody).error
    except ValueError:
        return None
    return words.splitlines()[0] if words.strip() else None


def _why_away(error: aiohttp.ClientError) -> str:
    """Return in one line why there is no answer: the library's words may be several, and quote what came."""
    words = error.message if isinstance(error, aiohttp.ClientResponseError) else str(error)
    if isinstance(error, aiohttp.ClientConnectorError) and not isinstance(error, aiohttp.ClientSSLError):
        number, told = error.os_error.errno, error.os_error.strerror
        # A name that is not known has a number below 0, and words of its own.
        words = (os.strerror(number) if number and number > 0 else told) or words
    if isinstance(error, aiohttp.InvalidURL):  # it repeats the address, with all that is in it
        words = "leads to what is no HTTP address"
    return " ".join(words.split())[:_MAX_SHOWN] or type(error).__name__
