"""Runs the integrations that the configuration names, and others after a reload."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Collection
from contextlib import asynccontextmanager

from server.integrations.mqtt.publisher import MqttPublisher
from server.integrations.mqtt.site_reader import SiteReader
from server.integrations.webhooks import Webhook
from server.service.facade.rules import PicturedEvent
from server.service.service import BestViewService

log = logging.getLogger(__name__)


class Integrations:
    """The webhooks and the MQTT connection of a service; of several of the same people the first has them."""

    def __init__(self, service: BestViewService) -> None:
        self._service = service
        self._reader = SiteReader(service)
        self._running: list[tuple[MqttPublisher | Webhook, asyncio.Task[None]]] = []
        self._settings: tuple[object, ...] = ()
        service.rules.subscribe_events(self._put_event)
        service.rules.subscribe_forget(self._forget)
        service.operations.subscribe_config(self.apply)

    def apply(self) -> None:
        """Start what the configuration names, and end what it no longer names."""
        config = self._service.config
        settings = (config.mqtt, tuple(config.webhooks), config.http.public_url)
        if settings == self._settings or not config.view.sharding.is_first:
            return
        self.stop()
        self._settings = settings
        url = config.http.public_url
        found: list[MqttPublisher | Webhook] = [Webhook(webhook, url) for webhook in config.webhooks]
        if config.mqtt.host is not None:
            found.append(MqttPublisher(config.mqtt, self._reader, url))
        self._running = [(each, asyncio.create_task(each.run(), name=type(each).__name__)) for each in found]
        for _, task in self._running:
            task.add_done_callback(_log_failure)

    def stop(self) -> list[asyncio.Task[None]]:
        """End all; return the tasks that are ending."""
        tasks = [task for _, task in self._running]
        for each, task in self._running:
            if isinstance(each, MqttPublisher):
                each.end()
            task.cancel()
        self._running = []
        return tasks

    def _forget(self, numbers: Collection[int]) -> None:
        for each, _ in self._running:
            each.forget(numbers)

    def _put_event(self, event: PicturedEvent) -> None:
        for each, _ in self._running:
            each.put_event(event)


def _log_failure(task: asyncio.Task[None]) -> None:
    if not task.cancelled() and (error := task.exception()) is not None:
        log.error("%s has failed; a changed configuration starts it again", task.get_name(), exc_info=error)


@asynccontextmanager
async def integrating(service: BestViewService) -> AsyncIterator[None]:
    """Run the integrations of a service."""
    integrations = Integrations(service)
    integrations.apply()
    try:
        yield
    finally:
        await asyncio.gather(*integrations.stop(), return_exceptions=True)
