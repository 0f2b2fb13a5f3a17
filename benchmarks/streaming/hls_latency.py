"""HLS latency of two players on the same service: one of segments (RFC 8216), one of low-latency parts."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import aiohttp
import numpy as np

from benchmarks.scaling.simulated_hall import SimulatedHall
from benchmarks.streaming.delay_drift import PacedCameras
from benchmarks.streaming.simulated_cameras import CAMERAS, ENCODE, GOP, SITE
from server.camera.encoder import AccessUnit
from server.config.sections import CameraSettings, HttpSettings, TrackSettings
from server.config.site_config import Config
from server.http.app import make_app, serving
from server.messaging.messages import GopChoices
from server.service.pipeline import BestViewPipeline
from server.service.service import BestViewService

_PER_CAMERA = 2
_BEFORE_S = 8.0
"""Seconds of video that exist when the players start."""
_PART = r'#EXT-X-PART:DURATION=([\d.]+),URI="([^"]+)".*'
_SEGMENT = r"#EXTINF:([\d.]+),\n(\S+)"
_LINE = re.compile(rf"^(?:{_PART}|{_SEGMENT})$", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class HlsLatency:
    """Median seconds from a frame's decision until a player has fetched it, and until it shows it."""

    fetched: float
    shown: float
    stalls: int


@dataclass
class _Player:
    """A simulated player that starts at a distance from the live edge and stalls where media are missing."""

    clock: Callable[[], float]
    decided: dict[int, float]
    """When each GOP was decided, by its first pulse."""
    start: float = 0.0
    """Clock time at which media time 0 is shown."""
    fetched: list[float] = field(default_factory=list)
    shown: list[float] = field(default_factory=list)
    stalls: int = 0

    def add(self, first: int, pulses: int) -> None:
        """Add newly fetched pulses."""
        now = self.clock()
        due = self.start + first / SITE.fps
        if not self.fetched:
            self.start = now - first / SITE.fps
        elif now > due:
            self.stalls += 1
            self.start += now - due
        for pulse in range(first, first + pulses):
            decided = self.decided[pulse // GOP * GOP]
            self.fetched.append(now - decided)
            self.shown.append(self.start + pulse / SITE.fps - decided)

    @property
    def latency(self) -> HlsLatency:
        """The median latencies so far."""
        return HlsLatency(float(np.median(self.fetched)), float(np.median(self.shown)), self.stalls)


async def hls_delays(films: Sequence[Sequence[AccessUnit]], seconds: float) -> tuple[HlsLatency, HlsLatency]:
    """Serve a decided camera in real time; return the latency without parts, and with them."""
    hall = SimulatedHall(CAMERAS, _PER_CAMERA)
    cameras = [
        CameraSettings(id=name, source=f"rtsp://{name}/", ground=ground.tolist())
        for name, ground in zip(hall.ids, hall.grounds, strict=True)
    ]
    track = TrackSettings(joint=False)  # simulated cameras send tracks alone
    service = BestViewPipeline(Config(site=SITE, encode=ENCODE, cameras=cameras, track=track))
    source, decided, clock = (
        PacedCameras(service, films, hall),
        dict[int, float](),
        asyncio.get_running_loop().time,
    )

    def record(choices: GopChoices) -> None:
        decided[choices.first] = clock()

    service.on_decision.append(record)
    before = round(_BEFORE_S * SITE.fps)
    for number in range(before):
        source.pulse(number)

    async def feed() -> None:
        start = clock()
        for number in range(before, before + round((seconds + 1) * SITE.fps)):
            await asyncio.sleep(max(0.0, start + (number - before) / SITE.fps - clock()))
            source.pulse(number)

    players = [_Player(clock, decided) for _ in range(2)]
    async with (
        serving(make_app(BestViewService(service)), HttpSettings(port=0)) as port,
        aiohttp.ClientSession(f"http://127.0.0.1:{port}/cameras/{hall.ids[0]}/hls/") as session,
    ):
        feeding = asyncio.create_task(feed())
        await asyncio.sleep(1.0)  # the video so far was published at once
        async with asyncio.TaskGroup() as group:
            group.create_task(_segments(session, players[0], seconds - 1))
            group.create_task(_parts(session, players[1], seconds - 1))
        await feeding
    service.close()
    return players[0].latency, players[1].latency


async def _segments(session: aiohttp.ClientSession, player: _Player, seconds: float) -> None:
    """Play whole segments, starting three target durations before the end (RFC 8216, 6.3.3 and 6.3.4)."""
    end, next_number = player.clock() + seconds, -1
    while player.clock() < end:
        text = await _text(session, "index.m3u8")
        target = int(_tag(text, "#EXT-X-TARGETDURATION:"))
        segments = [(float(entry[3]), entry[4]) for entry in _LINE.finditer(text) if entry[4]]
        frames = round(segments[0][0] * SITE.fps)
        numbers = [int(uri.partition(".")[0]) for _, uri in segments]
        if next_number < 0:
            last = (numbers[-1] + 1) * frames - 3 * target * SITE.fps
            next_number = max(
                number for number in numbers if number * frames <= max(last, numbers[0] * frames)
            )
        new = [number for number in numbers if number >= next_number]
        for number in new:
            await _fetch(session, f"{number}.m4s")
            player.add(number * frames, frames)
            next_number = number + 1
        await asyncio.sleep(target if new else target / 2)


async def _parts(session: aiohttp.ClientSession, player: _Player, seconds: float) -> None:
    """Play parts, starting PART-HOLD-BACK before the end, with blocking playlist reloads."""
    end = player.clock() + seconds
    text = await _text(session, "index.m3u8")
    part_pulses = round(float(_tag(text, "#EXT-X-PART-INF:PART-TARGET=")) * SITE.fps)
    hold_back_s = float(_tag(text, ".*PART-HOLD-BACK="))
    uris = [entry[2] for entry in _LINE.finditer(text) if entry[2]]
    waiting = uris[-max(1, round(hold_back_s * SITE.fps / part_pulses)) :]
    parts_per_segment = len({uri for uri in uris if uri.startswith(uris[0].partition(".")[0] + ".")})
    while player.clock() < end:
        for uri in waiting:
            segment, index = map(int, uri.split(".")[:2])
            await _fetch(session, uri)
            player.add((segment * parts_per_segment + index) * part_pulses, part_pulses)
            uris.append(uri)
        number, index = divmod(segment * parts_per_segment + index + 1, parts_per_segment)
        text = await _text(session, f"index.m3u8?_HLS_msn={number}&_HLS_part={index}")
        waiting = [entry[2] for entry in _LINE.finditer(text) if entry[2] and entry[2] not in uris]


async def _text(session: aiohttp.ClientSession, path: str) -> str:
    return (await _fetch(session, path)).decode()


async def _fetch(session: aiohttp.ClientSession, path: str) -> bytes:
    async with session.get(path) as answer:
        answer.raise_for_status()
        return await answer.read()


def _tag(text: str, name: str) -> str:
    found = re.search(rf"^{name}([\d.]+)", text, re.MULTILINE)
    assert found is not None  # noqa: S101 — every playlist of the service has it
    return found[1]
