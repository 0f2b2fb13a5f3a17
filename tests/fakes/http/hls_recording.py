"""A recorded site whose time shift is fetched as HLS."""

from __future__ import annotations

import asyncio
import re

from fakes.service.fed_site import Hall
from fakes.service.scripted_cameras import CAMERAS, GOP, NO_REASON, encoded, video
from fakes.service.scripted_recordings import PULSE0
from server.messaging.messages import GopChoices
from server.service.view_selection.decider import GopDecision, ObjectChoice

GOPS = 40
FRAMES = GOPS * GOP
HTTP = {"hls_segment_s": 0.4, "hls_window_s": 0.8}
"""Two GOPs in a segment, three segments in a playlist."""
LENGTH = 2 * GOP


def shows(hall: Hall, gops: range, choices: dict[int, str | None] | None = None) -> None:
    """Decide some GOPs of person 1, in alternating cameras or by `choices`; None: no pictures arrive."""
    service = hall.service
    for gop in gops:
        camera = CAMERAS[gop % 2] if choices is None else choices[gop]
        for seed, source in enumerate(CAMERAS if camera is not None else ()):
            for unit in encoded(seed, FRAMES)[gop * GOP : (gop + 1) * GOP]:
                service.ingest.video(video(source, unit))
        shown = {} if camera is None else {1: camera}
        service.recorder.put(
            GopChoices(first=gop * GOP, frames=GOP, choices=shown, boxes={}, cuts=[]), PULSE0
        )
        choice = ObjectChoice(1, camera, None, departed=False)
        service.splicer.publish_decision(GopDecision(gop * GOP, GOP, (choice,), {}, {}, (), NO_REASON))


async def until_written(hall: Hall, gops: int) -> None:
    while hall.service.recorder.writer is not None and hall.service.recorder.writer.written < gops:  # noqa: ASYNC110
        await asyncio.sleep(0.001)


def forget(hall: Hall) -> None:
    """Drop all GOPs but the newest from memory, so that they are read from the disk."""
    hall.service.recorder.recent._frames = GOP
    hall.service.recorder.recent._choices = type(hall.service.recorder.recent._choices)(
        [hall.service.recorder.recent._choices[-1]]
    )


async def fetch(hall: Hall, path: str) -> bytes:
    async with hall.session.get(path) as answer:
        assert answer.status == 200, await answer.text()
        return await answer.read()


async def text(hall: Hall, path: str) -> str:
    return (await fetch(hall, path)).decode()


def numbers(playlist: str) -> list[int]:
    return [int(number) for number in re.findall(r"^([0-9]+)\.m4s$", playlist, re.MULTILINE)]
