"""A small server of the HTTP API with scripted answers, and minimal fMP4, for tests of the Python client."""

from __future__ import annotations

import asyncio
import json
import struct
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any

from aiohttp import web

TIMESCALE = 90000
FPS = 25
GOP = 5


def box(kind: bytes, *content: bytes) -> bytes:
    body = b"".join(content)
    return struct.pack(">I4s", 8 + len(body), kind) + body


def header(units: int = TIMESCALE, picture: bytes = b"352x288") -> bytes:
    mdhd = box(b"mdhd", struct.pack(">IIIII", 0, 0, 0, units, 0))
    moov = box(b"moov", box(b"mvhd", bytes(8)), box(b"trak", box(b"tkhd", picture), box(b"mdia", mdhd)))
    return box(b"ftyp", b"isom") + moov


def fragment(pulse: int, version: int = 1) -> bytes:
    time = struct.pack(">BxxxQ" if version else ">BxxxI", version, pulse * TIMESCALE // FPS)
    moof = box(b"moof", box(b"mfhd", bytes(8)), box(b"traf", box(b"tfhd", bytes(8)), box(b"tfdt", time)))
    return moof + box(b"mdat", f"picture {pulse}".encode())


def sse_event(name: str, data: object) -> bytes:
    return f"event: {name}\ndata: {json.dumps(data)}\n\n".encode()


SITE: dict[str, Any] = {
    "name": "hall",
    "fps": float(FPS),
    "width": 352,
    "height": 288,
    "gop": GOP,
    "lookahead_s": 1.0,
    "codec": "avc1.42C01F",
    "pulse0": None,
    "now": 1732159200.5,
    "cameras": ["c0", "c1"],
}
OBJECTS: dict[str, Any] = {
    "objects": [
        {
            "object": 1,
            "first_seen": 3,
            "last_seen": 90,
            "visible": True,
            "camera": "c0",
            "cameras": ["c0", "c1"],
            "thumbnail": "/objects/1/thumb.jpg?v=123",
            "colour": "of a later version",
        }
    ]
}
CAMERAS: dict[str, Any] = {
    "cameras": [{"camera": "c0", "state": "live", "pulse": 90, "late": 0, "fps": 24.9, "message": ""}]
}
CHOICE: dict[str, Any] = {
    "object": 1,
    "first": 50,
    "frames": 25,
    "camera": "c0",
    "since": 40,
    "costs": {"c0": 0.31, "c1": None},
    "switch_cost_s": 25.0,
    "reason": "c0 shows it largest",
}


def gop(first: int, camera: str) -> dict[str, Any]:
    return {
        "first": first,
        "frames": GOP,
        "choices": {"1": camera, "2": None},
        "boxes": {"c0": [[[1, 10.0, 20.0, 30.5, 80.0]], *[[] for _ in range(GOP - 1)]]},
        "cuts": [{"object": 1, "from": "c0", "to": camera, "pulse": first}],
    }


StreamScript = Callable[[web.StreamResponse], Awaitable[None]]


async def send_nothing(_: web.StreamResponse) -> None:
    await asyncio.Event().wait()


@dataclass
class ScriptedSite:
    """Answers like the API; each connection consumes one script of its kind; without one, 503."""

    video_scripts: list[StreamScript] = field(default_factory=list)
    event_scripts: list[StreamScript] = field(default_factory=list)
    opened: int = 0

    def app(self) -> web.Application:
        app = web.Application()
        app.router.add_get("/api/site", _json(SITE))
        app.router.add_get("/api/objects", _json(OBJECTS))
        app.router.add_get("/api/cameras", _json(CAMERAS))
        app.router.add_get("/api/objects/1/choice", _json(CHOICE))
        app.router.add_get("/objects/1/best.mp4", self._stream(self.video_scripts, "video/mp4"))
        app.router.add_get("/api/events", self._stream(self.event_scripts, "text/event-stream"))
        app.router.add_get("/{rest:.*}", _not_found)
        return app

    def _stream(
        self, scripts: list[StreamScript], kind: str
    ) -> Callable[[web.Request], Awaitable[web.StreamResponse]]:
        async def answer(request: web.Request) -> web.StreamResponse:
            self.opened += kind == "video/mp4"
            if not scripts:
                return web.json_response({"error": "starting"}, status=503)
            response = web.StreamResponse(headers={"Content-Type": kind})
            await response.prepare(request)
            await scripts.pop(0)(response)
            return response

        return answer


def _json(data: object) -> Callable[[web.Request], Awaitable[web.StreamResponse]]:
    async def answer(_: web.Request) -> web.StreamResponse:
        return web.json_response(data)

    return answer


async def _not_found(_: web.Request) -> web.StreamResponse:
    return web.json_response({"error": "there is no such object"}, status=404)


Serve = Callable[[ScriptedSite], Awaitable[str]]
"""Serves a scripted site, and returns its address."""
