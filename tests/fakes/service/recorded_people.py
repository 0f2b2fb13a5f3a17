"""A site with tokens that has recorded two people, one of whom can be deleted."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from fakes.http.tokens import serve_with_tokens
from fakes.service.fed_site import ServedSite
from fakes.service.scripted_cameras import CAMERAS, LARGE
from server.messaging.messages import Box
from server.service.decision_files.live_decision_writer import LiveDecisionWriter

A, B = CAMERAS
FEET: Box = (22.0, 10.0, 28.0, 28.0)
EPOCHS = 16
ZONES = [{"id": "all", "camera": "c0", "area": [[0, 0], [64, 0], [64, 48], [0, 48]]}]
RULES = [
    {"id": "in", "kind": "entered", "zone": "all"},
    {"id": "ann", "kind": "left", "zone": "all", "people": ["Ann"]},
]


@asynccontextmanager
async def serve_recorded_people(folder: Path) -> AsyncIterator[ServedSite]:
    """Serve a recording site: person 1, Ann, is in both cameras for 8 epochs, person 2 in c1 all the time.

    The recording is in `kept`, the tracks are in `out`.
    """
    record = {"folder": str(folder / "kept"), "segment_s": 0.4}
    async with serve_with_tokens(folder, record=record, zones=ZONES, rules=RULES) as served:
        service = served.service
        service.frames = (EPOCHS + 16) * 5
        service.recorder.open()
        service.decision_writer = LiveDecisionWriter(
            folder / "out", service.config.camera_ids, service.decider.people.letterboxes
        )
        service.connect_cameras(*CAMERAS)
        for epoch in range(EPOCHS):
            show(served, epoch, ann=FEET if epoch < 8 else None)
        service.decider.people.registry.names = {1: "Ann"}
        assert service.recorder.writer is not None
        await asyncio.wrap_future(service.recorder.writer.run(lambda: None))  # all is on the disk
        yield served
        service.decision_writer.close()


def show(site: ServedSite, epoch: int, ann: Box | None) -> None:
    """Feed an epoch; None: Ann is not there."""
    site.service.feed(epoch, {A: {1: ann}, B: {1: ann, 2: LARGE}})
