"""The server's events as they happen."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

from yarl import URL

from client.http import AwayError, ContractError, HttpSettings, decode_json, get
from client.model import EVENTS, Event
from client.sse_parser import OverlongEventError, SentEvent, SseParser

_DEFAULT = HttpSettings()


async def events(
    url: str, settings: HttpSettings = _DEFAULT, *, delay: str | None = None
) -> AsyncIterator[Event]:
    """Yield Site, Objects, Cameras, Gop and Flag events without end; events of other names are ignored.

    Gop events have the choices of a ``delay``, by default ``balanced``.

    When the connection is lost the client connects again, to another server of ``settings`` where there is
    one. That sends its state once more, so an event may come twice.

    Raises:
        ValueError: ``url`` is no address.
        AwayError: ``settings.stream_retries`` attempts in a row brought no event.
        ClientError: the server refuses the request, or an event is invalid.
    """
    addresses = [server / "api/events" for server in settings.servers(url)]
    if delay is not None:
        addresses = [address.with_query({"delay": delay}) for address in addresses]
    backoff, attempts = settings.backoff(), 0
    while True:
        address = addresses[attempts % len(addresses)]
        try:
            async for event in _once(address, settings):
                backoff.reset()
                yield event
        except AwayError as error:
            problem = error
        else:
            problem = AwayError(f"{address.origin()}: the stream of events has ended")
        if backoff.failures >= settings.stream_retries:
            raise problem
        attempts += 1
        wait = backoff.next()
        if attempts % len(addresses) == 0:
            await asyncio.sleep(wait)


async def _once(address: URL, settings: HttpSettings) -> AsyncIterator[Event]:
    parser = SseParser()
    async with get(address, settings, "text/event-stream") as answer:
        async for data in answer.content.iter_any():
            try:
                sent_events = parser.feed(data)
            except OverlongEventError as error:
                raise ContractError(f"{address.origin()}: {error}") from error
            for sent_event in sent_events:
                event = _decode(sent_event)
                if event is not None:
                    yield event


def _decode(sent: SentEvent) -> Event | None:
    kind = EVENTS.get(sent.name)
    if kind is None:
        return None
    try:
        return decode_json(sent.data, kind)
    except ValueError as error:
        raise ContractError(f"event {sent.name}: {error}") from error
