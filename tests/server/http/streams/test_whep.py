"""WebRTC by WHEP: viewers get the cameras' own pictures, across cuts, as long as they may."""

from __future__ import annotations

import asyncio
import importlib
import re
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt
import pytest
from aiortc import RTCConfiguration, RTCPeerConnection, RTCRtpReceiver, RTCSessionDescription

from fakes.http.tokens import bearer, serve_with_tokens, token_entry, write_tokens
from fakes.service.fed_site import A, B, ServedSite, serve_site, show_people
from fakes.service.scripted_cameras import LARGE, SMALL, encoded

SDP = {"Content-Type": "application/sdp"}
Picture = npt.NDArray[np.uint8]


@cache
def pictures_of(seed: int) -> tuple[Picture, ...]:
    """Return the pictures of a camera as they are when decoded from its own stream."""
    decoder = av.CodecContext.create("h264", "r")
    frames = [frame for unit in encoded(seed) for frame in decoder.decode(av.Packet(unit.data))]
    return tuple(frame.to_ndarray(format="yuv420p") for frame in [*frames, *decoder.decode(None)])


def source_of(picture: Picture) -> tuple[int, int]:
    """Return the camera's number and the pulse of a picture, which is exactly as the camera sent it."""
    return next(
        (seed, pulse)
        for seed in (0, 1)
        for pulse, own in enumerate(pictures_of(seed))
        if np.array_equal(own, picture)
    )


@dataclass(slots=True)
class Viewer:
    """A WebRTC viewer."""

    connection: RTCPeerConnection
    session: str
    """The address of its session."""
    track: Any

    async def picture(self) -> tuple[int, int]:
        """Return the camera and the pulse of the next picture."""
        frame = await self.track.recv()
        return source_of(frame.to_ndarray(format="yuv420p"))


async def offer(*codecs: str) -> RTCPeerConnection:
    """Return a connection that offers to receive a video, in the order of preference of some codecs."""
    connection = RTCPeerConnection(RTCConfiguration(iceServers=[]))
    video = connection.addTransceiver("video", direction="recvonly")
    known = RTCRtpReceiver.getCapabilities("video").codecs
    video.setCodecPreferences([each for codec in codecs for each in known if each.name == codec])
    await connection.setLocalDescription(await connection.createOffer())
    return connection


async def post(
    site: ServedSite, path: str, body: str, headers: dict[str, str] | None = None
) -> tuple[int, str, str]:
    """Return the status, the address of the session and the body of the answer."""
    async with site.session.post(path, data=body, headers={**SDP, **(headers or {})}) as answer:
        return answer.status, answer.headers.get("Location", ""), await answer.text()


@asynccontextmanager
async def watching(
    site: ServedSite,
    path: str,
    headers: dict[str, str] | None = None,
    change: Callable[[str], str] = str,
) -> AsyncIterator[Viewer]:
    """Watch a stream; the offer may be changed on its way."""
    connection = await offer("VP8", "H264")  # as browsers do
    tracks = asyncio.Queue[Any]()
    connection.on("track", tracks.put_nowait)
    status, session, answer = await post(site, path, change(connection.localDescription.sdp), headers)
    assert status == 201, answer
    await connection.setRemoteDescription(RTCSessionDescription(answer, "answer"))
    try:
        yield Viewer(connection, session, await tracks.get())
    finally:
        await connection.close()


async def until_ended(site: ServedSite) -> None:
    """Wait until no viewer is counted."""
    while site.service.splicer.viewers or site.service.splicer.cameras[A].viewers:  # noqa: ASYNC110 — no event
        await asyncio.sleep(0.01)


async def test_the_best_view_goes_on_across_a_cut_with_the_cameras_own_pictures() -> None:
    async for site in serve_site(view={"min_shot_s": 0.0}):
        show_people(site)
        async with watching(site, "/objects/1/whep") as viewer:
            first = await viewer.picture()
            assert first[0] == 1  # c1, in which they are larger
            for epoch in range(3, 8):
                site.service.feed(epoch, {A: {1: LARGE}, B: {1: SMALL}})
            seen = [first]
            while seen[-1][0] == 1 or len(seen) < 12:
                seen.append(await viewer.picture())
        pulses = [pulse for _, pulse in seen]
        assert pulses == list(range(pulses[0], pulses[0] + len(seen)))
        assert {camera for camera, _ in seen} == {0, 1}
        await until_ended(site)


@pytest.mark.parametrize("path", ["/cameras/c0/whep", "/objects/1/whep?delay=live"])
async def test_a_session_is_live_and_ends_by_delete(path: str) -> None:
    async for site in serve_site():
        show_people(site)
        async with watching(site, path) as viewer:
            site.service.feed(3, {A: {1: LARGE}, B: {1: SMALL}})
            _, pulse = await viewer.picture()
            while pulse < 15:
                _, pulse = await viewer.picture()
            for status in (200, 404):
                async with site.session.delete(viewer.session) as answer:
                    assert answer.status == status
                await until_ended(site)


def hide_addresses(sdp: str) -> str:
    """Replace all addresses by one name that nobody resolves, as browsers in another network do."""
    hidden = re.sub(r"(?m)^(a=candidate:\S+ \d+ \S+ \d+ )\S+", r"\g<1>3c7f5a2e-0b1d.local", sdp)
    assert hidden != sdp
    return hidden


async def test_a_browser_that_hides_its_address_is_reached(site_with_people: ServedSite) -> None:
    async with watching(site_with_people, "/cameras/c0/whep", change=hide_addresses) as viewer:
        site_with_people.service.feed(3, {A: {1: LARGE}, B: {1: SMALL}})
        assert await viewer.picture()
        assert "c0/whep" in viewer.session


@pytest.mark.parametrize(
    ("path", "body", "headers", "status", "error"),
    [
        ("/objects/99/whep", "", {}, 404, "no object 99"),
        ("/cameras/c9/whep", "", {}, 404, "c9"),
        ("/cameras/c0/whep", "", {}, 400, "the SDP offer"),
        ("/cameras/c0/whep", "v=0\r\nm=video x\r\n", {}, 400, "the SDP offer"),
        ("/cameras/c0/whep", "\0" * 100, {}, 400, "the SDP offer"),
        ("/cameras/c0/whep", "v=0", {"Content-Type": "text/plain"}, 415, "application/sdp"),
        ("/cameras/c0/whep?delay=live", "", {}, 400, "delay"),
        ("/objects/1/whep?delay=soon", "", {}, 400, "delay=soon"),
        ("/objects/1/whep?camera=c0", "", {}, 400, "camera"),
    ],
)
async def test_an_invalid_request_is_one_line(
    site_with_people: ServedSite, path: str, body: str, headers: dict[str, str], status: int, error: str
) -> None:
    code, _, answer = await post(site_with_people, path, body, headers)
    assert (code, error in answer, len(answer.splitlines())) == (status, True, 1)
    await until_ended(site_with_people)


async def test_an_offer_without_h264_is_refused(site_with_people: ServedSite) -> None:
    connection = await offer("VP8")
    code, _, answer = await post(site_with_people, "/cameras/c0/whep", connection.localDescription.sdp)
    await connection.close()
    assert (code, "no H.264" in answer) == (400, True)


async def test_offers_with_any_change_are_answered_or_refused_in_one_line(
    site_with_people: ServedSite,
) -> None:
    connection = await offer("H264")
    text = connection.localDescription.sdp
    await connection.close()
    rng = np.random.default_rng(1)
    for _ in range(60):
        lines = text.splitlines(keepends=True)
        at = int(rng.integers(len(lines)))
        cut = int(rng.integers(len(lines[at])))
        changed = [lines[at][:cut], lines[at][:cut] + "9" + lines[at][cut:], "", lines[at] * 2]
        lines[at] = changed[int(rng.integers(4))]
        code, session, answer = await post(site_with_people, "/cameras/c0/whep", "".join(lines))
        assert code in {201, 400}, answer
        if code == 201:
            await (await site_with_people.session.delete(session)).release()
        else:
            assert len(answer.splitlines()) == 1
    await until_ended(site_with_people)


async def test_without_the_extra_the_answer_says_what_to_install(
    site_with_people: ServedSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    code, _, answer = await post(site_with_people, "/cameras/c0/whep", "v=0")
    assert (code, "pip install 'myview[webrtc]'" in answer) == (501, True)


async def test_viewers_are_limited_as_those_of_other_streams() -> None:
    async for site in serve_site(http={"viewers_per_object": 1}):
        show_people(site)
        async with watching(site, "/objects/1/whep"):
            connection = await offer("H264")
            code, _, answer = await post(site, "/objects/1/whep", connection.localDescription.sdp)
            await connection.close()
            assert (code, "http.viewers_per_object" in answer) == (503, True)


async def test_a_session_ends_when_its_token_is_revoked_and_needs_one(tmp_path: Path) -> None:
    async with serve_with_tokens(tmp_path) as site:
        show_people(site)
        assert (await post(site, "/cameras/c0/whep", "v=0"))[0] == 401
        assert (await post(site, "/cameras/c0/whep", "v=0", bearer("family")))[0] == 403
        assert (await post(site, "/objects/1/whep?delay=live", "v=0", bearer("family")))[0] == 403
        async with watching(site, "/cameras/c0/whep", bearer("desk")) as viewer:
            await viewer.picture()
            async with site.session.delete(viewer.session, headers=bearer("family")) as answer:
                assert answer.status == 403
            write_tokens(tmp_path / "tokens.yaml", token_entry("lead"))
            await until_ended(site)


async def test_sessions_end_with_the_service() -> None:
    async for site in serve_site():
        show_people(site)
        async with watching(site, "/cameras/c0/whep") as viewer:
            await viewer.picture()
            site.service.splicer.close()
            await until_ended(site)
