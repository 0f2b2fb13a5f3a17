"""The same recordings give the same tracks and the same cuts, byte for byte, live and offline."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from fakes.running.site import CAMERAS, MYVIEW, configuration, running, with_timeout
from fakes.running.stream_frames import FPS
from synthetic import Scene, write_recording

SECONDS = 5.0
WRITTEN = (
    "choices.csv",
    "choices-live.csv",
    "choices-smooth.csv",
    "corrections.csv",
    "events.csv",
    "late.csv",
    *(f"tracks/{camera}.txt" for camera in CAMERAS),
)

ZONE = {"id": "middle", "area": [[2, 1.5], [6, 1.5], [6, 4.5], [2, 4.5]], "hold_s": 0.1}
RULES = [
    {"id": "in", "kind": "entered", "zone": "middle"},
    {"id": "out", "kind": "left", "zone": "middle"},
    {"id": "stays", "kind": "stayed", "zone": "middle", "longer_than_s": 1},
    {"id": "pair", "kind": "close", "closer_than_m": 2, "hold_s": 0.1},
]

pytestmark = [pytest.mark.live]


async def rendered(config: Path, recording: Path, out: Path) -> None:
    process = await asyncio.create_subprocess_exec(
        *MYVIEW,
        "render",
        *(str(recording / f"{camera}.mp4") for camera in CAMERAS),
        "--config",
        str(config),
        "--out",
        str(out),
    )
    assert await with_timeout(process.wait()) == 0


@pytest.mark.parametrize(
    ("joint", "codec"),
    [
        (False, "h264"),
        pytest.param(True, "h264", marks=pytest.mark.slow),
        pytest.param(False, "h265", marks=pytest.mark.slow),
    ],
)
async def test_live_equals_offline_to_the_byte(tmp_path: Path, codec: str, *, joint: bool) -> None:
    recording = tmp_path / "room"
    write_recording(Scene("room", len(CAMERAS), 4, 1, 320, 180, FPS), recording, SECONDS)
    # Long timeouts, so that no frame is skipped on a busy machine.
    config = configuration(
        tmp_path,
        recording,
        detects=True,
        track={"cross_view_wait_s": 60, "joint": joint},
        view={"late_after_s": 60},
        zenoh={"lease_s": 60},
        encode={"codec": codec},
        zones=[ZONE],
        rules=RULES,
    )
    await rendered(config, recording, tmp_path / "offline")
    async with running(config, "--out", str(tmp_path / "live"), listen=False) as site:
        assert await site.wait_for_exit() == 0, "\n".join(site.lines)
    for name in WRITTEN:
        live, offline = (tmp_path / way / name for way in ("live", "offline"))
        assert live.read_bytes() == offline.read_bytes(), f"{name} differs\n" + "\n".join(site.lines)
    assert (tmp_path / "live" / "late.csv").read_text() == "frame,camera,reason\n"
    choices = (tmp_path / "live" / "choices.csv").read_text().splitlines()
    events = (tmp_path / "live" / "events.csv").read_text().splitlines()
    assert len(events) > 3, "people walk through the middle of the room"
    assert len(choices) > 2 * SECONDS * FPS, "more than two people per frame were detected"
    assert {line.rsplit(",")[2] for line in choices[1:]} <= set(CAMERAS)
    assert sorted(path.name for path in (tmp_path / "offline" / "best").iterdir()), "a film per person"
