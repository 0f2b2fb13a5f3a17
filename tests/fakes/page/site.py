"""A small site with the HTTP API for tests of the page: three cameras with test patterns."""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import sys
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import av
from aiohttp import web

from fakes.page.video_pattern import (
    CAMERAS,
    FPS,
    GOP,
    HEIGHT,
    SQUARE,
    WIDTH,
    pattern,
    picture,
    second,
    square,
)
from fakes.paths import PAGE

LOOKAHEAD = 10  # frames between the current pulse and the served one
SEGMENT = 2 * GOP  # frames of a segment of HLS
HOLD = 3 * GOP  # frames for which person 1 is shown by one camera
FIRST_PULSE = 12_345_678  # first pulse: far from zero, as on a site that has run for days

REASON = "Another camera sees this person a little better, but not by enough to be worth a cut so soon."
# As strict as a server may be: no foreign origins, no inline scripts or styles.
POLICY = "default-src 'self'; media-src 'self' blob:; img-src 'self' data: blob:"


@dataclass(slots=True)
class FakeSite:
    """The state of a fake site, with switches for faults.

    Args:
        bursts: Send whole GOPs at once instead of frame by frame.
        people: People by number, and whether they are in view.
        aliases: Former ids of people.
        elsewhere: People at other sites, as the API lists them.
        split: The splits that every GOP reports.
        first_pulse: Pulse at about the time when the site is created.
        skipped: Pulses whose frames are missing from every stream.
        codec: Codec of the streams; None: no keyframe has arrived yet.
        opened: People whose streams were requested, in order.
        listed: Requested HLS playlists, in order.
        fetched: First pulses of the requested HLS segments, in order.
        replayable_from: The first recorded pulse.
        recorded: Seconds of the past that are recorded.
        past_released: Set to send more of a replay than its first frame; None: all is sent at once.
        ahead: Seconds by which the streams are ahead of the clock, to let time pass quickly.
        blind_pulses: Pulses, in whole GOPs, at which the first camera detects no one.
        undetected: Share of the look-ahead in which no camera detects the person.
        operates: Whether viewers may operate.
        flags: Flags for the operator.
        pointed: The position corrections received.
        busy: Messages of cameras about shed load.
        lost: Messages of cameras whose source is lost and is opened again in an hour.
        stays: Stays that a search of the past finds, one answer each; what is missing is filled in.
        searched: Queries of searches of the past.
        pulse0: Unix seconds at which pulse 0 was due.
    """

    bursts: bool = False
    people: dict[int, bool] = field(default_factory=lambda: {1: True, 2: True})
    aliases: dict[int, list[int]] = field(default_factory=dict)
    elsewhere: list[dict[str, Any]] = field(default_factory=list)
    split: list[dict[str, Any]] = field(default_factory=list)
    first_pulse: int = FIRST_PULSE
    skipped: range = range(0)
    codec: str | None = "avc1.42C01F"
    opened: list[int] = field(default_factory=list)
    listed: list[str] = field(default_factory=list)
    fetched: list[int] = field(default_factory=list)
    replayable_from: int = 0
    recorded: int = 0
    past_released: asyncio.Event | None = None
    ahead: float = 0.0
    blind_pulses: range = range(0)
    undetected: float = 0.0
    operates: bool = False
    flags: list[dict[str, Any]] = field(default_factory=list)
    pointed: list[dict[str, Any]] = field(default_factory=list)
    busy: dict[str, str] = field(default_factory=dict)
    lost: dict[str, str] = field(default_factory=dict)
    stays: list[dict[str, Any]] = field(default_factory=list)
    searched: list[dict[str, str]] = field(default_factory=list)
    pulse0: float = field(init=False)

    def __post_init__(self) -> None:
        self.pulse0 = time.time() - (self.first_pulse + LOOKAHEAD + 3 * GOP) / FPS

    @property
    def edge(self) -> int:
        """Return the newest pulse that is decided and served."""
        return int((time.time() + self.ahead - self.pulse0) * FPS) - LOOKAHEAD

    def camera(self, person: int, pulse: int) -> int:
        return (pulse // HOLD) % len(CAMERAS) if person == 1 else 2

    def shown(self, person: int, pulse: int, held: str | None, preferred: str | None) -> int:
        """Return the camera of a pulse in a stream with an optional fixed or preferred camera."""
        if held is not None:
            return CAMERAS.index(held)
        if preferred is not None:
            seen = [CAMERAS.index(preferred) or at not in self.blind_pulses for at in (pulse, pulse - GOP)]
            return CAMERAS.index(preferred) if all(seen) else self.camera(person, pulse)
        return self.camera(person, pulse)

    def site(self) -> dict[str, Any]:
        return {
            "name": "Test patterns",
            "fps": FPS,
            "width": WIDTH,
            "height": HEIGHT,
            "gop": GOP,
            "lookahead_s": LOOKAHEAD / FPS,
            "codec": self.codec,
            "pulse0": self.pulse0,
            "now": time.time(),
            "cameras": list(CAMERAS),
        }

    def objects(self) -> dict[str, Any]:
        objects = [self._object(person, seen) for person, seen in self.people.items()]
        return {"objects": objects, "elsewhere": self.elsewhere}

    def _object(self, person: int, seen: bool) -> dict[str, Any]:
        return {
            "object": person,
            "aliases": self.aliases.get(person, []),
            "first_seen": self.first_pulse,
            "last_seen": self.edge if seen else self.first_pulse,
            "visible": seen,
            "camera": CAMERAS[self.camera(person, self.edge)] if seen else None,
            "cameras": list(CAMERAS[: 1 + person % 3]) if seen else [],
            "thumbnail": f"/objects/{person}/thumb.jpg?v=1",
        }

    def cameras(self) -> dict[str, Any]:
        return {
            "cameras": [
                {"camera": c, "pulse": self.edge, "late": 0, "fps": FPS}
                | {"state": "gone" if c in self.lost else "live"}
                | {"message": self.lost.get(c) or self.busy.get(c, "")}
                | {"retry_at": time.time() + 3600 if c in self.lost else None}
                for c in CAMERAS
            ]
        }

    def gop(self, first: int) -> dict[str, Any]:
        """Return the `gop` event of the frames [first, first + GOP)."""
        choices = {str(k): CAMERAS[self.camera(k, first)] for k in self.people}
        cuts = []
        old, new = self.camera(1, first - 1), self.camera(1, first)
        if old != new:
            cuts.append({"object": 1, "from": CAMERAS[old], "to": CAMERAS[new], "pulse": first})
        boxes = {c: [self._boxes(m, n) for n in range(first, first + GOP)] for m, c in enumerate(CAMERAS)}
        return {
            "first": first,
            "frames": GOP,
            "choices": choices,
            "boxes": boxes,
            "cuts": cuts,
            "merged": [],
            "split": self.split,
        }

    def _boxes(self, camera: int, pulse: int) -> list[list[float]]:
        corners = {1: square(camera, pulse), 2: second(camera, pulse)}
        return [
            [k, left, top, left + SQUARE, top + SQUARE]
            for k, (left, top) in corners.items()
            if self.people.get(k) and (camera or pulse not in self.blind_pulses)
        ]

    def choice(self, person: int, first: int) -> dict[str, Any]:
        """Return the explanation of a person's view in the GOP [first, first + GOP)."""
        shown = self.camera(person, first)
        costs = {camera: 0.0 if n == shown else 0.25 * (n + 1) for n, camera in enumerate(CAMERAS)}
        return {
            "object": person,
            "first": first,
            "frames": GOP,
            "camera": CAMERAS[shown],
            "since": first,
            "costs": costs | {CAMERAS[shown - 1]: None},
            "seen": {camera: 1.0 - cost for camera, cost in costs.items()},
            "quality": {camera: 1.0 - cost for camera, cost in costs.items()},
            "undetected": dict.fromkeys(CAMERAS, self.undetected),
            "terms": {camera: {"size": 1.0 - cost, "truncation": 1.0} for camera, cost in costs.items()},
            "weights": {"size": 1.0, "truncation": 0.1},
            "before": CAMERAS[shown],
            "lookahead_s": LOOKAHEAD / FPS,
            "switch_cost_s": 0.3,
            "stay_s": 0.0,
            "cut_s": 0.37,
            "cut_to": CAMERAS[(shown + 1) % len(CAMERAS)],
            "reason": REASON,
        }

    def past(self, person: int, since: int = 0) -> dict[str, Any]:
        """Return the recorded views of a person, from the pulse `since` on."""
        first = (self.edge - self.recorded * FPS) // HOLD * HOLD
        views = [
            {"camera": CAMERAS[self.camera(person, pulse)], "first": pulse, "frames": HOLD}
            for pulse in range(max(first, since), self.edge - HOLD, HOLD)
        ]
        return {"spans": [], "views": views}

    async def released(self, first: int) -> AsyncIterator[int]:
        """Yield the pulses from `first` on, each when it may be sent."""
        pulse = first
        while True:
            until = pulse - pulse % GOP + GOP - 1 if self.bursts else pulse
            due = self.pulse0 - self.ahead + (until + LOOKAHEAD) / FPS
            await asyncio.sleep(max(0.0, due - time.time()))
            yield pulse
            pulse += 1

    def boundary(self) -> int:
        """Return the first pulse of the newest complete GOP (in bursts) or of the current one."""
        edge = self.edge - (GOP - 1 if self.bursts else 0)
        return edge - edge % GOP


def thumbnail(person: int) -> bytes:
    """Return a JPEG of the person's square."""
    left, top = (square if person == 1 else second)(0, 10)
    crop = picture(0, 10)[top - 10 : top + SQUARE + 10, left - 6 : left + SQUARE + 6]
    file = io.BytesIO()
    with av.open(file, "w", format="mjpeg") as container:
        stream = container.add_stream("mjpeg", rate=1)
        stream.height, stream.width = crop.shape[0] // 2 * 2, crop.shape[1] // 2 * 2
        stream.pix_fmt = "yuvj420p"
        frame = av.VideoFrame.from_ndarray(crop[: stream.height, : stream.width].copy(), format="rgb24")
        container.mux(stream.encode(frame.reformat(format="yuvj420p")))
        container.mux(stream.encode(None))
    return file.getvalue()


class SiteServer:
    """Serves a FakeSite and the page on one port, where it can be stopped and restarted."""

    def __init__(self, site: FakeSite) -> None:
        self.site = site
        self.port = 0
        self._runner: web.AppRunner | None = None
        self._streams: set[asyncio.Transport] = set()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    async def start(self) -> None:
        app = web.Application()
        app.router.add_get("/", _file)
        app.router.add_get("/page/{name:.+}", _file)
        app.router.add_get("/api/site", self._site)
        app.router.add_get("/api/session", self._session)
        app.router.add_get("/api/operator/position_corrections", self._pointing)
        app.router.add_post("/api/operator/position_corrections", self._pointing)
        app.router.add_get("/api/events", self._events)
        app.router.add_get("/api/objects/{k}/choice", self._choice)
        app.router.add_get("/api/objects/{k}/past", self._past)
        app.router.add_get("/api/past", self._decisions)
        app.router.add_get("/api/past/search", self._search)
        app.router.add_get("/api/rules", self._rules)
        app.router.add_get("/objects/{k}/best.mp4", self._best)
        app.router.add_get("/cameras/{camera}/live.mp4", self._best)
        app.router.add_get("/{of}/{k}/hls/index.m3u8", self._playlist)
        app.router.add_get("/{of}/{k}/hls/{file}", self._segment)
        app.router.add_get("/objects/{k}/thumb.jpg", self._thumbnail)
        app.router.add_get("/recording.mp4", self._recording)
        self._runner = web.AppRunner(app, shutdown_timeout=0.05, handler_cancellation=True)
        await self._runner.setup()
        listener = web.TCPSite(self._runner, "127.0.0.1", self.port, reuse_address=True)
        await listener.start()
        self.port = self._runner.addresses[0][1]

    async def stop(self) -> None:
        if self._runner:
            await self._runner.cleanup()
            self._runner = None

    async def restart_as(self, site: FakeSite) -> None:
        """Restart as another site on the same port."""
        await self.stop()
        self.site = site
        await self.start()

    async def break_streams(self) -> None:
        """Abort the connections of all videos, as a bad network does."""
        for transport in self._streams:
            transport.abort()

    async def _site(self, _: web.Request) -> web.Response:
        return web.json_response(self.site.site())

    async def _session(self, _: web.Request) -> web.Response:
        """Return a session that may watch, or operate."""
        role = "operate" if self.site.operates else "watch"
        return web.json_response(
            {"by_token": False, "name": None, "role": role, "object": None, "camera": None}
        )

    async def _pointing(self, request: web.Request) -> web.Response:
        accepted = 0
        if request.method == "POST":
            body = await request.json()
            self.site.pointed.append(body)
            accepted = len(body["corrections"])
        return web.json_response({"unavailable": "", "accepted": accepted, "too_old": 0, "flags": []})

    async def _choice(self, request: web.Request) -> web.Response:
        k, pulse = int(request.match_info["k"]), int(request.query.get("at", f"p{self.site.edge}")[1:])
        if pulse < self.site.replayable_from:
            return web.json_response({"error": "not kept"}, status=404)
        return web.json_response(self.site.choice(k, pulse - pulse % GOP))

    async def _past(self, request: web.Request) -> web.Response:
        first = int(request.query.get("from", "p0")[1:])
        return web.json_response(self.site.past(int(request.match_info["k"]), first))

    async def _decisions(self, request: web.Request) -> web.Response:
        first, end = (int(request.query[name][1:]) for name in ("from", "to"))
        gops = range(first - first % GOP, min(end, self.site.edge), GOP)
        return web.Response(text="".join(json.dumps(self.site.gop(gop)) + "\n" for gop in gops))

    async def _search(self, request: web.Request) -> web.Response:
        """Answer with one stay at a time."""
        site = self.site
        site.searched.append(dict(request.query))
        if not site.stays:
            return web.json_response({"error": "zone: 'till': there is no such area"}, status=400)
        stay = site.stays[len(site.searched) - 1]
        is_last = len(site.searched) == len(site.stays)
        begins = datetime.fromtimestamp(site.pulse0 + stay["first"] / FPS, UTC).isoformat()
        filled: dict[str, Any] = {
            "run": None,
            "name": None,
            "zone": None,
            "camera": None,
            "begins": begins,
            "clip": None,
        }
        filled |= {"seconds": stay["frames"] / FPS, "cameras": list(CAMERAS[:2]), **stay}
        next_pulse = None if is_last else stay["first"] + stay["frames"]
        answer = {"stays": [filled], "found": 1, "next": next_pulse, "ends": begins, "zones": ["till"]}
        return web.json_response(answer)

    async def _rules(self, _: web.Request) -> web.Response:
        zones = [{"zone": "till", "area": [[0, 0], [1, 0], [1, 1]]}, {"zone": "door", "area": None}]
        return web.json_response({"units_per_meter": 1.0, "zones": zones, "rules": [], "events": []})

    async def _thumbnail(self, request: web.Request) -> web.Response:
        return web.Response(body=thumbnail(int(request.match_info["k"])), content_type="image/jpeg")

    async def _best(self, request: web.Request) -> web.StreamResponse:
        site, k = self.site, int(request.match_info.get("k", 1))
        site.opened.append(k)
        if k not in site.people:
            return web.json_response({"error": f"no object {k}"}, status=404)
        held = request.match_info.get("camera", request.query.get("camera"))
        first = int(request.query.get("from", f"p{site.boundary()}")[1:])
        if "from" in request.query and first < site.replayable_from:
            return web.json_response({"error": "not kept"}, status=416)
        first -= first % GOP
        end = int(request.query.get("to", f"p{sys.maxsize}")[1:])
        waits = site.past_released if "from" in request.query else None
        response = web.StreamResponse(headers={"Content-Type": "video/mp4"})
        await response.prepare(request)
        transport = request.transport
        assert isinstance(transport, asyncio.Transport)
        self._streams.add(transport)
        with contextlib.suppress(ConnectionError):
            await response.write(pattern(0).init)
            async for pulse in site.released(first):
                if pulse >= end:
                    break
                if pulse not in site.skipped:
                    shown = site.shown(k, pulse, held, request.query.get("prefer"))
                    await response.write(pattern(shown).fragment(pulse))
                if waits:
                    await waits.wait()
        return response

    async def _playlist(self, request: web.Request) -> web.Response:
        site, lines = self.site, ["#EXTM3U", "#EXT-X-VERSION:7", "#EXT-X-TARGETDURATION:1"]
        last = site.boundary() - site.boundary() % SEGMENT
        first = int(request.query.get("from", f"p{last - 8 * SEGMENT}")[1:]) // SEGMENT * SEGMENT
        start_time = datetime.fromtimestamp(site.pulse0 + first / FPS, UTC).isoformat(timespec="milliseconds")
        lines += [f"#EXT-X-MEDIA-SEQUENCE:{first // SEGMENT}", '#EXT-X-MAP:URI="init.mp4"']
        lines += ["#EXT-X-START:TIME-OFFSET=0"] if "from" in request.query else []
        lines += [f"#EXT-X-PROGRAM-DATE-TIME:{start_time}"]
        for pulse in range(first, last, SEGMENT):
            lines += [f"#EXTINF:{SEGMENT / FPS:.3f},", f"{pulse}.m4s"]
        site.listed.append(request.path_qs)
        return web.Response(text="\n".join(lines) + "\n", content_type="application/vnd.apple.mpegurl")

    async def _segment(self, request: web.Request) -> web.Response:
        site, k, file = self.site, request.match_info["k"], request.match_info["file"]
        if file == "init.mp4":
            return web.Response(body=pattern(0).init, content_type="video/mp4")
        pulses = range(int(file.split(".")[0]), int(file.split(".")[0]) + SEGMENT)
        shown = [CAMERAS.index(k) if k in CAMERAS else site.camera(int(k), pulse) for pulse in pulses]
        site.fetched.append(pulses.start)
        data = b"".join(pattern(m).fragment(n) for m, n in zip(shown, pulses, strict=True))
        return web.Response(body=data, content_type="video/mp4")

    async def _recording(self, request: web.Request) -> web.Response:
        frames = range(int(request.query["first"]), int(request.query["end"]))
        data = pattern(0).init + b"".join(pattern(0).fragment(pulse) for pulse in frames)
        return web.Response(body=data, content_type="video/mp4")

    async def _events(self, request: web.Request) -> web.StreamResponse:
        site = self.site
        response = web.StreamResponse(headers={"Content-Type": "text/event-stream"})
        await response.prepare(request)
        with contextlib.suppress(ConnectionError):
            for name in ("site", "objects", "cameras"):
                await response.write(_event(name, getattr(site, name)()))
            sent_people, sent_flags = (dict(site.people), site.elsewhere), list[dict[str, Any]]()
            async for pulse in site.released(site.boundary() - 2 * GOP):
                if (site.people, site.elsewhere) != sent_people:
                    sent_people = (dict(site.people), site.elsewhere)
                    await response.write(_event("objects", site.objects()))
                if pulse % GOP == 0:
                    await response.write(_event("gop", site.gop(pulse)))
                for flag in site.flags:
                    if flag not in sent_flags:
                        sent_flags.append(flag)
                        await response.write(_event("flag", flag))
        return response


def _event(name: str, data: dict[str, Any]) -> bytes:
    return f"event: {name}\ndata: {json.dumps(data)}\n\n".encode()


async def _file(request: web.Request) -> web.StreamResponse:
    path = PAGE / request.match_info.get("name", "index.html")
    return web.FileResponse(path, headers={"Content-Security-Policy": POLICY})


@contextlib.asynccontextmanager
async def serving(site: FakeSite) -> AsyncIterator[SiteServer]:
    """Serve a site on a port that the system chooses."""
    server = SiteServer(site)
    await server.start()
    try:
        yield server
    finally:
        await server.stop()
