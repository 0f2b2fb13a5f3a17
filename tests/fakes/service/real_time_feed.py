"""Feeds a site with two cameras' encoded video at its own rate: two people, each larger in another camera."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from fakes.service.fed_site import ServedSite
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    LARGE,
    SMALL,
    STRIDE,
    camera_tracks,
    encoded,
    tracks,
    video,
)
from server.media.picture import Codec
from server.messaging.epochs import end_of_epoch

FRAMES = 25 * FPS


def feed_epoch(served: ServedSite, epoch: int, codec: Codec, *, first_is_larger_in_first: bool) -> None:
    """Send an epoch of both cameras, and decide it."""
    sizes = (LARGE, SMALL) if first_is_larger_in_first else (SMALL, LARGE)
    for seed, camera in enumerate(CAMERAS):
        for unit in encoded(seed, FRAMES, codec=codec)[epoch * STRIDE : (epoch + 1) * STRIDE]:
            served.service.ingest.receive_video(video(camera, unit))
        boxes = {1: sizes[seed], 2: sizes[1 - seed]}
        served.service.ingest.receive_tracks(tracks(camera_tracks(camera, epoch, boxes)))
    served.service.pulses.newest = end_of_epoch(epoch, STRIDE)
    served.service.decide()


async def feed_in_real_time(feed: Callable[[int], None]) -> None:
    """Send the epochs from the fourth on by ``feed``, at the site's rate."""
    for epoch in range(3, FRAMES // STRIDE):
        feed(epoch)
        await asyncio.sleep(STRIDE / FPS)
