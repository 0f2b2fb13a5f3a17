"""A small fake site with an accelerated clock: hours of streams and events in minutes."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from aiohttp import web

from benchmarks.common.environment import ROOT
from server.camera.encoder import Encoder
from server.config.sections import EncodeSettings, SiteSettings
from server.media.containers.fmp4 import init_segment, shift_fragment, ticks
from server.media.stream_format import StreamFormat
from server.service.streaming.frame_buffer import FrameBuffer

_PAGE = ROOT / "client" / "page"
_WIDTH, _HEIGHT = 160, 96
_FPS = _GOP = 5
_LOOP = 10 * _GOP
"""Frames after which the pictures repeat."""
_CAMERAS = ("c0", "c1", "c2", "c3")
_PEOPLE = 6
_SHOT = 7
"""GOPs after which the camera of a person changes."""
_AHEAD = 2 * _GOP
"""Frames of the look-ahead."""


@dataclass(frozen=True, slots=True)
class FastClock:
    """The site's clock, ``speed`` times as fast as real time."""

    speed: float
    begun: float

    def now(self) -> float:
        """Return the site's time of day, unix seconds."""
        return self.begun + (time.time() - self.begun) * self.speed

    async def until(self, moment: float) -> None:
        """Wait until a moment of the site's time."""
        await asyncio.sleep(max(0.0, (moment - self.now()) / self.speed))


class FastSite:
    """Serves the page and its API, with a loop of encoded pictures at new times."""

    def __init__(self, clock: FastClock) -> None:
        self._clock = clock
        self._stream_format = StreamFormat()
        self._fragments = [self._loop(seed) for seed in range(len(_CAMERAS))]
        assert self._stream_format.parameters is not None  # noqa: S101 — pictures have been packed
        self._head = init_segment(self._stream_format.parameters, _WIDTH, _HEIGHT)

    def app(self) -> web.Application:
        """Return the web application."""
        app = web.Application()
        app.router.add_get("/", _file)
        app.router.add_get("/page/{name}", _file)
        app.router.add_get("/api/site", self._site)
        app.router.add_get("/api/events", self._events)
        app.router.add_get("/api/objects/{object}/choice", self._choice)
        app.router.add_get("/objects/{object}/best.mp4", self._best)
        return app

    def _loop(self, seed: int) -> list[bytes]:
        site, rng = SiteSettings(width=_WIDTH, height=_HEIGHT, fps=_FPS), np.random.default_rng(seed)
        encoder, frame_buffer = (
            Encoder(site, EncodeSettings(gop_s=_GOP / _FPS)),
            FrameBuffer(_FPS, _LOOP, self._stream_format),
        )
        small = rng.integers(0, 255, (_LOOP, _HEIGHT // 16, _WIDTH // 16, 3), dtype=np.uint8)
        for pulse, picture in enumerate(small.repeat(16, axis=1).repeat(16, axis=2)):
            unit = encoder.encode(pulse, picture)
            frame_buffer.put(pulse, 1, unit.data, key=unit.key)
        return [frame.fragment for pulse in range(_LOOP) if (frame := frame_buffer.get(pulse)) is not None]

    @property
    def _edge(self) -> int:
        """The first pulse of the newest decided GOP."""
        return (int((self._clock.now() - self._clock.begun) * _FPS) - _AHEAD) // _GOP * _GOP

    async def _released(self) -> AsyncIterator[int]:
        first = max(0, self._edge - _GOP)
        while True:
            await self._clock.until(self._clock.begun + (first + _GOP + _AHEAD) / _FPS)
            yield first
            first += _GOP

    def _describe(self) -> dict[str, Any]:
        assert self._stream_format.codec is not None  # noqa: S101 — as above
        return {
            "name": "Hours",
            "fps": _FPS,
            "width": _WIDTH,
            "height": _HEIGHT,
            "gop": _GOP,
            "lookahead_s": _AHEAD / _FPS,
            "codec": self._stream_format.codec,
            "container": "mp4",
            "sound": None,
            "cameras": list(_CAMERAS),
            "pulse0": self._clock.begun,
            "now": self._clock.now(),
        }

    async def _site(self, _: web.Request) -> web.Response:
        return web.json_response(self._describe())

    async def _choice(self, request: web.Request) -> web.Response:
        number = int(request.match_info["object"])
        shown = _CAMERAS[_camera(number, int(request.query.get("at", f"p{self._edge}")[1:]))]
        some = dict.fromkeys(_CAMERAS, 0.5)
        return web.json_response(
            {
                "object": number,
                "camera": shown,
                "since": 0,
                "reason": "It sees the person best.",
                "costs": some,
                "seen": some,
                "terms": {camera: {"size": 0.5} for camera in _CAMERAS},
                "weights": {"size": 1.0},
                "before": shown,
                "stay_s": 0.0,
                "cut_to": None,
                "cut_s": None,
                "switch_cost_s": 1.0,
                "lookahead_s": _AHEAD / _FPS,
            }
        )

    async def _best(self, request: web.Request) -> web.StreamResponse:
        number = int(request.match_info["object"])
        response = web.StreamResponse(headers={"Content-Type": "video/mp4"})
        with contextlib.suppress(ConnectionError):  # the page switches to another person
            await response.prepare(request)
            await response.write(self._head)
            async for first in self._released():
                loop = self._fragments[_camera(number, first)]
                moved = ticks(first - first % _LOOP, _FPS)
                gop = [shift_fragment(piece, moved) for piece in loop[first % _LOOP : first % _LOOP + _GOP]]
                await response.write(b"".join(gop))
        return response

    async def _events(self, request: web.Request) -> web.StreamResponse:
        response = web.StreamResponse(headers={"Content-Type": "text/event-stream"})
        cameras = [
            {"camera": camera, "state": "live", "pulse": 0, "late": 0, "fps": _FPS, "message": ""}
            for camera in _CAMERAS
        ]
        with contextlib.suppress(ConnectionError):
            await response.prepare(request)
            await response.write(_event("site", self._describe()))
            await response.write(_event("cameras", {"cameras": cameras}))
            async for first in self._released():
                await response.write(_event("objects", _people(first)) + _event("gop", _gop(first)))
        return response


def _camera(number: int, pulse: int) -> int:
    return (pulse // (_SHOT * _GOP) + number) % len(_CAMERAS)


def _there(first: int) -> list[int]:
    """Return the people in view: a new number every few minutes, each known for at most an hour."""
    newest = first // (_FPS * 600)
    return list(range(newest, newest + _PEOPLE))


def _people(first: int) -> dict[str, Any]:
    return {
        "objects": [
            {
                "object": number,
                "aliases": [],
                "first_seen": 0,
                "last_seen": first,
                "visible": True,
                "camera": _CAMERAS[_camera(number, first)],
                "cameras": list(_CAMERAS),
                "thumbnail": None,
            }
            for number in _there(first)
        ]
    }


def _gop(first: int) -> dict[str, Any]:
    boxes = [
        [
            [n, 20.0 * place + frame, 10.0, 20.0 * place + frame + 12, 60.0]
            for place, n in enumerate(_there(first))
        ]
        for frame in range(_GOP)
    ]
    return {
        "first": first,
        "frames": _GOP,
        "cuts": [],
        "merged": [],
        "split": [],
        "choices": {str(number): _CAMERAS[_camera(number, first)] for number in _there(first)},
        "boxes": dict.fromkeys(_CAMERAS, boxes),
    }


def _event(name: str, data: dict[str, Any]) -> bytes:
    return f"event: {name}\ndata: {json.dumps(data)}\n\n".encode()


async def _file(request: web.Request) -> web.StreamResponse:
    return web.FileResponse(_PAGE / request.match_info.get("name", "index.html"))


@contextlib.asynccontextmanager
async def serving(clock: FastClock) -> AsyncIterator[str]:
    """Serve the site on a free port; yield its address."""
    site = await asyncio.to_thread(FastSite, clock)
    runner = web.AppRunner(site.app(), shutdown_timeout=0.05, handler_cancellation=True)
    await runner.setup()
    try:
        await web.TCPSite(runner, "127.0.0.1", 0).start()
        yield f"http://127.0.0.1:{runner.addresses[0][1]}/"
    finally:
        await runner.cleanup()
