"""A running service: its pulses, frames and tracks come from the test."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from fakes.service.scripted_cameras import (
    CAMERAS,
    LARGE,
    SMALL,
    STRIDE,
    FedService,
    camera_tracks,
    encoded,
    small_config,
    tracks,
    video,
)
from server.config.site_config import Config
from server.messaging.messages import Box
from server.service.pulse_follower import PulseFollower

ENCODED = 40 // STRIDE
"""Epochs of encoded pictures; then they repeat, from a keyframe on."""


_BOXES = dict(zip(CAMERAS, (SMALL, LARGE), strict=True))


def send_epoch(service: FedService, epoch: int, *cameras: str, boxes: Mapping[str, Box] = _BOXES) -> None:
    """Send an epoch's frames and track messages of some cameras; ``boxes`` of person 1 by camera."""
    for seed, camera in enumerate(CAMERAS):
        if camera not in cameras:
            continue
        encoded_epoch = epoch % ENCODED
        for unit in encoded(seed)[encoded_epoch * STRIDE : (encoded_epoch + 1) * STRIDE]:
            service.ingest.receive_video(
                video(camera, replace(unit, pulse=unit.pulse + (epoch - encoded_epoch) * STRIDE))
            )
        service.ingest.receive_tracks(tracks(camera_tracks(camera, epoch, {1: boxes[camera]})))


class PulsesOfTest(PulseFollower):
    """Pulses that the test sends."""

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self.sent: asyncio.Queue[int] = asyncio.Queue()
        self.followed = asyncio.Event()
        """Set once the service follows them: it has started."""

    async def follow(self, on_pulse: Callable[[], None]) -> None:
        self.followed.set()
        while True:
            self.newest = await self.sent.get()
            on_pulse()


class RunningService(FedService):
    """A running service whose pulses come from the test."""

    pulses: PulsesOfTest

    def __init__(self, **changes: Any) -> None:
        super().__init__(small_config(**changes))
        self.pulses = PulsesOfTest(self.config)
        self.connect_cameras(*CAMERAS)

    async def receive(self, epoch: int, *cameras: str) -> None:
        """Send an epoch of some cameras, and let the service process it."""
        send_epoch(self, epoch, *cameras)
        self._changed.set()
        await self.process()

    async def process(self) -> None:
        """Let the service's tasks run."""
        for _ in range(50):
            begun = self.decider.people._association
            if begun is not None and not begun.is_taken:
                await begun.wait()
            await asyncio.sleep(0)
