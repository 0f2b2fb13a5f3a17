"""Requests to a MyView server: addresses, timeouts, retries, and errors in one line."""

from __future__ import annotations

import asyncio
import os
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field, replace
from typing import TypeVar

import aiohttp
import msgspec
from yarl import URL

from expbackoff import Backoff

MAX_BODY = 64_000_000
"""Largest response that is read as a whole, in bytes; all objects of a large site take some millions."""
_MAX_ERROR_BODY = 64_000
"""Largest error response in bytes."""
_MAX_SHOWN = 300
"""Characters of a library's message."""
_SILENT_S, _SILENT_GOPS = 1.0, 2.5
"""Silence after which a server that can be replaced counts as gone."""
_JSON = "application/json"
_NOT_FOUND = 404
_CLIENT_ERRORS = range(400, 500)
_ANSWER = TypeVar("_ANSWER")


class ClientError(Exception):
    """A request has failed; the message is one line for people."""


class NotFoundError(ClientError):
    """The server knows no such object, camera or moment (404)."""


class RefusedError(ClientError):
    """The server refuses the request (4xx); repeating it will not help."""


class AwayError(ClientError):
    """The server cannot be reached, or the connection is lost."""


class ServerError(AwayError):
    """The server answers that it cannot do this now (5xx)."""


class ContractError(ClientError):
    """The response is not that of a MyView server of this version."""


@dataclass(frozen=True, slots=True)
class HttpSettings:
    """Timeouts, retries of streams, and the token of the client."""

    connect_timeout: float = 5.0
    """Seconds to connect."""
    read_timeout: float = 15.0
    """Seconds without a byte until the connection counts as lost."""
    answer_timeout: float = 60.0
    """Seconds until a response must have begun, and until one that is read whole must be complete."""
    stream_retries: int = 26
    """Retries in a row before a stream is abandoned; 0: none."""
    backoff_first: float = 0.25
    """Seconds before the first retry; doubled each time."""
    backoff_most: float = 1.0
    """Maximum of the seconds between attempts."""
    token: str | None = field(default=None, repr=False)
    """Bearer token, for a server that requires one."""
    others: tuple[str, ...] = ()
    """Further servers of the same site, in the order in which they replace one that does not answer."""

    def servers(self, url: str) -> list[URL]:
        """Return the addresses of all servers, first that of ``url``.

        Raises:
            ValueError: one is no address.
        """
        return list(dict.fromkeys(map(server_url, (url, *self.others))))

    def failing_over(self, url: str, others: tuple[str, ...], gop_s: float) -> HttpSettings:
        """Return the settings for a site that also has these servers, and sends something every GOP.

        A server that is silent for more than two GOPs, and at least a second, is then left for another one.
        Servers without TLS are left out where ``url`` has it, and addresses that are none.
        """
        servers = [str(server) for server in self.servers(url)]
        for other in others:
            with suppress(ValueError):
                server = server_url(other)
                if server.scheme == server_url(url).scheme or server.scheme == "https":
                    servers.append(str(server))
        _, *more = dict.fromkeys(servers)
        if not more:
            return self
        silence = max(_SILENT_S, _SILENT_GOPS * gop_s)
        return replace(
            self,
            others=tuple(more),
            connect_timeout=min(self.connect_timeout, _SILENT_S),
            read_timeout=min(self.read_timeout, silence),
        )

    def backoff(self) -> Backoff:
        """Return the delays between attempts of a stream."""
        return Backoff(self.backoff_first, self.backoff_most)


def server_url(text: str) -> URL:
    """Parse a server's address as typed or pasted; a link to its page works too.

    Raises:
        ValueError: ``text`` is not an HTTP address.
    """
    # Errors do not repeat the text: it may contain a token or a password.
    typed = text if "://" in text else f"http://{text}"
    _, *beyond = re.split("[/?#]", typed.partition("://")[2])
    if any("@" in part for part in beyond):  # the apparent host may be part of a password
        raise ValueError(
            "the address has an @ behind its host: in a name or password / ? # and @ are %2F %3F %23 and %40"
        )
    try:
        url = URL(typed)
    except ValueError:
        url = URL()
    if url.scheme not in {"http", "https"} or not url.host:
        raise ValueError("this is not an address like http://host:port")
    return url.with_query(None).with_fragment(None)


@asynccontextmanager
async def get(url: URL, settings: HttpSettings, accept: str) -> AsyncIterator[aiohttp.ClientResponse]:
    """Open a response for reading, in one attempt; a network error inside the block is an AwayError too.

    Raises:
        NotFoundError, RefusedError, AwayError: with the server's error text if it sent one.
    """
    async with get_any(url, settings, accept) as answer:
        await _check(answer, settings)
        yield answer


@asynccontextmanager
async def get_any(url: URL, settings: HttpSettings, accept: str) -> AsyncIterator[aiohttp.ClientResponse]:
    """Open a response of any status for reading; errors as `_request`."""
    async with _request("GET", url, settings, accept) as answer:
        yield answer


@asynccontextmanager
async def _request(
    method: str, url: URL, settings: HttpSettings, accept: str, content: object = None
) -> AsyncIterator[aiohttp.ClientResponse]:
    """Open a response of any status, to a request with this content as JSON unless it is None.

    Raises:
        AwayError: there is no response, or a network error occurs inside the block.
    """
    timeout = aiohttp.ClientTimeout(
        total=None, sock_connect=settings.connect_timeout, sock_read=settings.read_timeout
    )
    try:
        async with aiohttp.ClientSession(timeout=timeout) as session:
            async with asyncio.timeout(settings.answer_timeout):
                headers = _headers(settings, accept)
                opening = await session.request(method, url, headers=headers, json=content)
            async with opening as answer:
                yield answer
    except aiohttp.TooManyRedirects as error:
        raise AwayError(f"{url.origin()}: too many redirects") from error
    except aiohttp.ClientError as error:
        raise AwayError(f"{url.origin()}: {_why_away(error)}") from error
    except TimeoutError as error:
        raise AwayError(f"{url.origin()}: no answer") from error


async def get_body(url: URL, settings: HttpSettings, accept: str) -> bytes:
    """Fetch a whole body.

    Raises:
        ClientError: the request fails, or the body is larger than MAX_BODY.
    """
    async with get(url, settings, accept) as answer:
        return await read_body(answer, settings)


async def read_body(answer: aiohttp.ClientResponse, settings: HttpSettings, most: int = MAX_BODY) -> bytes:
    """Read a whole body.

    Raises:
        ContractError: it is larger than ``most`` bytes.
        TimeoutError: reading takes longer than ``settings.answer_timeout``.
    """
    body = bytearray()
    async with asyncio.timeout(settings.answer_timeout):
        async for data in answer.content.iter_any():
            body += data
            if len(body) > most:
                raise ContractError(f"{answer.url.origin()}: the answer is larger than {most} bytes")
    return bytes(body)


async def read_lines(answer: aiohttp.ClientResponse, most: int) -> AsyncIterator[bytes]:
    """Yield the lines of a body without their line ends; an incomplete last line is dropped.

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
    """Fetch and decode JSON.

    Raises:
        ClientError: the request fails, or the body is not of type ``kind``.
    """
    return _decode_answer(url, await get_body(url, settings, _JSON), kind)


async def post_json(url: URL, content: object, kind: type[_ANSWER], settings: HttpSettings) -> _ANSWER:
    """Send JSON that changes something; decode the answer; errors as `get_json`."""
    async with _request("POST", url, settings, _JSON, content) as answer:
        await _check(answer, settings)
        body = await read_body(answer, settings)
    return _decode_answer(url, body, kind)


def _decode_answer(url: URL, body: bytes, kind: type[_ANSWER]) -> _ANSWER:
    try:
        return decode_json(body, kind)
    except ValueError as error:
        raise ContractError(f"{url.origin()} does not answer like MyView: {error}") from error


def decode_json(text: bytes | str, kind: type[_ANSWER]) -> _ANSWER:
    """Decode JSON.

    Raises:
        ValueError: the text is not JSON, or not of type ``kind``.
    """
    try:
        return msgspec.json.decode(text, type=kind)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def _headers(settings: HttpSettings, accept: str) -> dict[str, str]:
    heads = {"Accept": accept, "X-MyView-Changes": "1"}  # which tells pages of other sites apart
    return heads if settings.token is None else {**heads, "Authorization": f"Bearer {settings.token}"}


async def _check(answer: aiohttp.ClientResponse, settings: HttpSettings) -> None:
    if answer.ok:
        return
    try:
        message = _error_text(await read_body(answer, settings, _MAX_ERROR_BODY))
    except ContractError:
        message = None
    message = message or f"{answer.status} {answer.reason}"
    if answer.status == _NOT_FOUND:
        raise NotFoundError(message)
    if answer.status in _CLIENT_ERRORS:
        raise RefusedError(message)
    raise ServerError(f"{answer.url.origin()}: {message}")


class _ErrorBody(msgspec.Struct):
    error: str


def _error_text(body: bytes) -> str | None:
    """Return the first line of the server's error text; None without one."""
    try:
        message = decode_json(body, _ErrorBody).error
    except ValueError:
        return None
    return message.splitlines()[0] if message.strip() else None


def _why_away(error: aiohttp.ClientError) -> str:
    """Return in one line why there is no response; aiohttp's text may be long and quote received data."""
    message = "its answer is not valid HTTP" if isinstance(error, aiohttp.ClientResponseError) else str(error)
    if isinstance(error, aiohttp.ClientConnectorError) and not isinstance(error, aiohttp.ClientSSLError):
        number, text = error.os_error.errno, error.os_error.strerror
        # The resolver's errors have numbers below 0, and texts of their own.
        message = (os.strerror(number) if number and number > 0 else text) or message
    if isinstance(error, aiohttp.InvalidURL):  # its text repeats the address, secrets included
        message = "redirects to an address that is not HTTP"
    return " ".join(message.split())[:_MAX_SHOWN] or type(error).__name__
