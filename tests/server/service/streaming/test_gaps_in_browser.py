"""Chromium plays over a camera's missing pictures: Media Source Extensions see no gap."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest

from fakes.media.browser_playback import PLAY_JS, play_in_chromium
from fakes.programs import needs_chromium
from fakes.service.fed_site import A, ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, NO_REASON, SMALL, encoded
from server.service.view_selection.decider import GopDecision, ObjectChoice

GOPS = 12
SILENT = (4, 5, 6, 9)
LOST = 53
"""A pulse whose picture is lost, in an otherwise complete GOP."""


@pytest.fixture
async def served() -> AsyncIterator[ServedSite]:
    """A site whose viewers may be slow."""
    async for site_served in serve_site(http={"viewer_queue_gops": GOPS}):
        yield site_served


@needs_chromium
async def test_media_source_extensions_play_over_missing_pictures_to_the_end(served: ServedSite) -> None:
    splicer, frame_buffer = served.service.splicer, served.service.frame_buffers[A]
    served.service.connect_cameras(*CAMERAS)
    served.service.feed(0, {A: {1: SMALL}})
    for unit in encoded(0, GOPS * GOP):
        if unit.pulse // GOP not in SILENT and unit.pulse != LOST:
            frame_buffer.put(unit.pulse, 1, unit.data, key=unit.key)

    def show(gop: int) -> None:
        choice = ObjectChoice(1, A if frame_buffer.has(gop * GOP) else None, None, departed=False)
        splicer.publish_decision(GopDecision(gop * GOP, GOP, (choice,), {}, {}, (), NO_REASON))

    show(0)
    parameters = served.service.stream_format.parameters
    assert parameters is not None
    played = await play_in_chromium(
        *(served.port, splicer, GOPS, show),
        *(PLAY_JS, "/objects/1/best.mp4", f'video/mp4; codecs="{parameters.codec}"', 4),
    )
    assert (played["error"], played["ranges"]) == ("", 1)
    assert played["range"] == [0, pytest.approx(GOPS * GOP / FPS)]
