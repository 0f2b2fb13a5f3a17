"""A recorded site whose time shift is fetched as HLS."""

from __future__ import annotations

import asyncio
import re

from fakes.service.fed_site import ServedSite
from fakes.service.scripted_cameras import CAMERAS, GOP, NO_REASON, encoded, video
from fakes.service.scripted_recordings import PULSE0
from server.messaging.messages import GopChoices
from server.service.view_selection.decider import GopDecision, ObjectChoice

GOPS = 40
FRAMES = GOPS * GOP
HTTP_SETTINGS = {"hls_segment_s": 0.4, "hls_window_s": 0.8}
"""Two GOPs in a segment, three segments in a playlist."""
SEGMENT_FRAMES = 2 * GOP


def decide_gops(served: ServedSite, gops: range, choices: dict[int, str | None] | None = None) -> None:
    """Decide some GOPs of person 1, in alternating cameras or by `choices`; None: no pictures arrive."""
    service = served.service
    for gop in gops:
        camera = CAMERAS[gop % 2] if choices is None else choices[gop]
        for seed, source in enumerate(CAMERAS if camera is not None else ()):
            for unit in encoded(seed, FRAMES)[gop * GOP : (gop + 1) * GOP]:
                service.ingest.receive_video(video(source, unit))
        shown = {} if camera is None else {1: camera}
        service.recorder.put(
            GopChoices(first=gop * GOP, frames=GOP, choices=shown, boxes={}, cuts=[]), PULSE0
        )
        choice = ObjectChoice(1, camera, None, departed=False)
        service.splicer.publish_decision(GopDecision(gop * GOP, GOP, (choice,), {}, {}, (), NO_REASON))


async def wait_until_written(served: ServedSite, gops: int) -> None:
    while served.service.recorder.writer is not None and served.service.recorder.writer.written < gops:  # noqa: ASYNC110
        await asyncio.sleep(0.001)


def drop_from_memory(served: ServedSite) -> None:
    """Drop all GOPs but the newest from memory, so that they are read from the disk."""
    served.service.recorder.recent._frames = GOP
    served.service.recorder.recent._choices = type(served.service.recorder.recent._choices)(
        [served.service.recorder.recent._choices[-1]]
    )


async def fetch(served: ServedSite, path: str) -> bytes:
    async with served.session.get(path) as answer:
        assert answer.status == 200, await answer.text()
        return await answer.read()


async def fetch_text(served: ServedSite, path: str) -> str:
    return (await fetch(served, path)).decode()


def segment_numbers(playlist: str) -> list[int]:
    return [int(number) for number in re.findall(r"^([0-9]+)\.m4s$", playlist, re.MULTILINE)]
