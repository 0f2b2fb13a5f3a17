"""Webhooks: posts events to addresses, signed, again and again until they are taken.

The scheme is Standard Webhooks 1.0 (https://www.standardwebhooks.com): the headers ``webhook-id``,
``webhook-timestamp`` and ``webhook-signature``, an HMAC-SHA256 of ``ID.TIMESTAMP.BODY`` in base64. It is
two lines (:func:`sign`): its library would add a class around them.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
import logging
import time
from collections import deque
from collections.abc import Collection

import aiohttp
import msgspec
from tenacity import (
    AsyncRetrying,
    RetryError,
    retry_if_exception_type,
    stop_after_attempt,
    wait_exponential,
    wait_random,
)

from logthrottle import LogThrottle
from server.config.sections import WebhookSettings
from server.integrations.secret_files import read_webhook_key
from server.service.facade.rules import PicturedEvent, event_without
from server.system.address_redaction import redact_to_host
from server.system.errors import UserError

log = logging.getLogger(__name__)

_QUEUE_MAX = 100
"""Events that wait for one address; the oldest are lost."""
_ATTEMPTS = 8
_FIRST_S, _MAX_S = 1.0, 120.0
"""Seconds between two attempts: first, and at most."""
_TIMEOUT = aiohttp.ClientTimeout(total=10.0)
_TAKEN = range(200, 300)


class _RefusedError(Exception):
    """The other side did not take an event; the text says why, without its address."""


def sign(key: bytes, message_id: str, timestamp: int, body: bytes) -> str:
    """Return the signature of a message, Standard Webhooks 1.0: ``v1,`` and the HMAC-SHA256 in base64."""
    signed = f"{message_id}.{timestamp}.".encode() + body
    return f"v1,{base64.b64encode(hmac.digest(key, signed, hashlib.sha256)).decode()}"


def encode_event(event: PicturedEvent, url: str | None, *, with_picture: bool) -> bytes:
    """Return the body of a webhook: ``type``, ``timestamp`` and ``data``, the event with whole addresses.

    ``url`` is the page's address; None: links are relative.
    """
    record = event.record
    data = msgspec.to_builtins(record)
    base = "" if url is None else f"{url.rstrip('/')}/"
    for name in ("picture", "clip"):
        data[name] = None if data[name] is None else base + data[name]
    if with_picture and event.jpeg is not None:
        data["picture_data"] = f"data:image/jpeg;base64,{base64.b64encode(event.jpeg).decode()}"
    return msgspec.json.encode({"type": f"rule.{record.kind}", "timestamp": record.time, "data": data})


class Webhook:
    """Posts events to one address, in their order. ``run`` ends only by cancellation.

    An event that is not taken is tried again, waiting longer each time, and then given up.
    """

    def __init__(self, settings: WebhookSettings, url: str | None, first_s: float = _FIRST_S) -> None:
        self._settings, self._url, self._first_s = settings, url, first_s
        self._waiting: deque[PicturedEvent] = deque(maxlen=_QUEUE_MAX)
        self._current: PicturedEvent | None = None
        """The event that is being posted; None: there is none, or it is not to be posted any more."""
        self._has_waiting = asyncio.Event()
        self._failures, self._losses = LogThrottle(), LogThrottle()
        self._where = f"webhook {redact_to_host(settings.url)}"

    def put_event(self, event: PicturedEvent) -> None:
        """Post an event, if it is of a rule of this webhook."""
        if self._settings.rules and event.record.rule not in self._settings.rules:
            return
        if len(self._waiting) == _QUEUE_MAX and (more := self._losses.record()) is not None:
            log.warning("%s: too many events wait; the oldest are lost%s", self._where, more)
        self._waiting.append(event)
        self._has_waiting.set()

    def forget(self, numbers: Collection[int]) -> None:
        """Remove people from events that wait, and events about nobody else."""
        kept = (event_without(event, numbers) for event in self._waiting)
        self._waiting = deque((event for event in kept if event is not None), maxlen=_QUEUE_MAX)
        self._current = self._current and event_without(self._current, numbers)

    async def run(self) -> None:
        """Post events as they come."""
        async with aiohttp.ClientSession(timeout=_TIMEOUT) as session:
            while True:
                await self._has_waiting.wait()
                while self._waiting:
                    self._current = self._waiting.popleft()
                    await self._deliver(session, self._current.record.id)
                self._has_waiting.clear()

    async def _deliver(self, session: aiohttp.ClientSession, event_id: str) -> None:
        """Post the current event until it is taken, or given up."""
        attempts = AsyncRetrying(
            stop=stop_after_attempt(_ATTEMPTS),
            wait=wait_exponential(multiplier=self._first_s, max=_MAX_S) + wait_random(0.0, self._first_s),
            retry=retry_if_exception_type(_RefusedError),
        )
        try:
            async for attempt in attempts:
                with attempt:
                    if self._current is not None:
                        await self._post(session, self._current)
        except RetryError:
            log.warning("%s: event %s was not taken, and is given up", self._where, event_id)

    async def _post(self, session: aiohttp.ClientSession, event: PicturedEvent) -> None:
        body = encode_event(event, self._url, with_picture=self._settings.pictures)
        try:
            headers = self._headers(event.record.id, body)
            async with session.post(
                self._settings.url, data=body, headers=headers, allow_redirects=False
            ) as answer:
                if answer.status in _TAKEN:
                    return
                raise self._refused(f"status {answer.status}")
        except (aiohttp.ClientError, TimeoutError) as error:
            # Its text may have the whole address.
            raise self._refused(_reason(error)) from None
        except UserError as error:
            raise self._refused(str(error)) from None

    def _headers(self, message_id: str, body: bytes) -> dict[str, str]:
        timestamp = int(time.time())
        headers = {
            "Content-Type": "application/json",
            "webhook-id": message_id,
            "webhook-timestamp": str(timestamp),
        }
        if self._settings.secret is not None:
            key = read_webhook_key(self._settings.secret, "webhooks: secret")
            headers["webhook-signature"] = sign(key, message_id, timestamp, body)
        return headers

    def _refused(self, reason: str) -> _RefusedError:
        if (more := self._failures.record(reason)) is not None:
            log.warning("%s: %s%s; trying again", self._where, reason, more)
        return _RefusedError(reason)


def _reason(error: Exception) -> str:
    if isinstance(error, TimeoutError):
        return "no answer in time"
    cause = getattr(error, "os_error", None)
    return (cause.strerror if cause is not None else None) or type(error).__name__
