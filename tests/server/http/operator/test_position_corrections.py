"""Position corrections by the operator: which are accepted, and what the camera receives."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import aclosing
from typing import Any

import msgspec
import pytest

from fakes.service.fed_site import A, B, ServedSite, serve_site, show_people
from fakes.service.scripted_cameras import FPS, HEIGHT, LARGE, SMALL, STRIDE, WIDTH, camera_tracks, tracks
from server.camera.operator_corrections import CorrectionInbox
from server.http.access.csrf import CSRF_HEADER
from server.messaging.inbox import Message
from server.messaging.operator_messages import PositionCorrections, RiskEvent

CORRECTIONS = "/api/operator/position_corrections"


@pytest.fixture
async def assisted() -> AsyncIterator[ServedSite]:
    """Serve a site whose cameras accept corrections: object 1 in both, 2 in c0 alone."""
    async with aclosing(serve_site(track={"assist": {"enabled": True, "memory_s": 10 / FPS}})) as sites:
        served = await anext(sites)
        show_people(served)
        yield served


def record_corrections(served: ServedSite) -> list[tuple[str, PositionCorrections]]:
    """Collect the corrections that cameras receive from now on."""
    received: list[tuple[str, PositionCorrections]] = []

    def send(camera: str, payload: bytes) -> None:
        received.append((camera, msgspec.msgpack.decode(payload, type=PositionCorrections)))

    served.service.assist._send = send
    return received


async def post_corrections(served: ServedSite, *corrections: Any, **fields: Any) -> tuple[int, Any]:
    body = {"object": 1, "camera": A, "corrections": list(corrections), **fields}
    async with served.session.post(CORRECTIONS, headers={CSRF_HEADER: "1"}, json=body) as answer:
        return answer.status, await answer.json()


def at(pulse: int, x: float = 12.0, y: float = 20.0, **more: float) -> dict[str, float]:
    return {"pulse": pulse, "x": x, "y": y, **more}


async def test_a_camera_receives_the_corrections_with_its_track_id(assisted: ServedSite) -> None:
    received = record_corrections(assisted)
    status, answer = await post_corrections(assisted, at(2), at(7, tolerance=3.0), object=2)
    assert (status, answer["accepted"], answer["too_old"], answer["flags"]) == (200, 2, 0, [])
    [(camera, sent)] = received
    assert (camera, sent.boot) == (A, 1)
    assert [
        (correction.pulse, correction.track, correction.x, correction.y) for correction in sent.corrections
    ] == [
        (2, 2, 12, 20),
        (7, 2, 12, 20),
    ]
    assert [correction.tolerance for correction in sent.corrections] == [pytest.approx(0.02 * WIDTH), 3.0]
    status, answer = await post_corrections(assisted, at(7), camera=B)
    assert (status, answer["accepted"]) == (200, 1)
    assert received[1][0] == B
    assert (await post_corrections(assisted, at(7, tolerance=1e-200)))[0] == 200
    assert received[2][1].corrections[0].tolerance == 1.0, "the tolerance is at least a pixel"


async def test_corrections_that_are_too_old_are_counted_and_not_sent(assisted: ServedSite) -> None:
    for epoch in range(3, 9):
        assisted.service.feed(epoch, {A: {1: SMALL, 2: SMALL}, B: {1: LARGE}})
    received = record_corrections(assisted)
    status, answer = await post_corrections(assisted, at(2), at(30))
    assert (status, answer["accepted"], answer["too_old"]) == (200, 1, 1)
    assert [correction.pulse for correction in received[0][1].corrections] == [30]
    assert (await post_corrections(assisted, at(2)))[0] == 409
    assert len(received) == 1


@pytest.mark.parametrize(
    ("fields", "status", "reason"),
    [
        ({"object": 9}, 404, "there is no object 9"),
        ({"camera": "c9"}, 404, "there is no camera 'c9'"),
        ({"object": 2, "camera": B}, 409, "camera c1 did not show object 2"),
        ({"corrections": []}, 400, "length >= 1"),
        ({"corrections": [at(1)] * 257}, 400, "length <= 256"),
        ({"corrections": [at(1, x=WIDTH + 1)]}, 400, f"is not in a picture of {WIDTH}x{HEIGHT}"),
        ({"corrections": [at(1, y=-1)]}, 400, "is not in a picture"),
        ({"corrections": [at(999)]}, 400, "pulse 999 is in the future"),
        ({"corrections": [at(1, tolerance=0)]}, 400, "> 0"),
        ({"corrections": [{"pulse": -1, "x": 1, "y": 1}]}, 400, ">= 0"),
        ({"who": 1}, 400, "unknown field"),
    ],
    ids=str,
)
async def test_an_invalid_correction_is_refused_with_one_line(
    assisted: ServedSite, fields: dict[str, Any], status: int, reason: str
) -> None:
    received = record_corrections(assisted)
    code, answer = await post_corrections(assisted, at(7), **fields)
    assert code == status
    assert reason in answer["error"]
    assert "\n" not in answer["error"]
    assert received == []


async def test_a_page_of_another_origin_cannot_send_corrections(assisted: ServedSite) -> None:
    body = {"object": 1, "camera": A, "corrections": [at(7)]}
    async with assisted.session.post(CORRECTIONS, json=body) as answer:
        assert answer.status == 403


async def test_without_assistance_corrections_are_refused_with_the_reason(
    site_with_people: ServedSite,
) -> None:
    status, answer = await post_corrections(site_with_people, at(7))
    assert (status, answer["error"]) == (409, "cameras accept no corrections: track.assist.enabled is off")
    assert (await site_with_people.get_json(CORRECTIONS))["unavailable"] == answer["error"]


async def test_a_flag_is_raised_followed_answered_and_counted(assisted: ServedSite) -> None:
    expected = 4 * STRIDE
    crossing = RiskEvent(reason="crossing", tracks=[1, 2], pulse=expected, margin=0.1, risk=0.5)
    unknown = [RiskEvent(reason="optimality_gap", tracks=[], pulse=17, margin=0.0, risk=0.5)]
    unknown += [RiskEvent(reason="track_loss", tracks=[77], pulse=17, margin=0.0, risk=0.5)]
    assisted.service.ingest.receive_tracks(
        tracks(camera_tracks(A, 3, {1: SMALL, 2: SMALL}, risk_events=[*unknown, crossing]))
    )
    assisted.service.ingest.receive_tracks(tracks(camera_tracks(B, 3, {1: LARGE})))
    assisted.service.pulses.newest = 4 * STRIDE - 1
    assisted.service.decide()

    async def flags() -> list[Any]:
        return [
            (flag["id"], flag["objects"], flag["state"])
            for flag in (await assisted.get_json("/api/flags"))["flags"]
        ]

    assert await flags() == [(1, [1, 2], "raised")]
    assert (await post_corrections(assisted, at(7)))[1]["flags"] == [1]
    assert await flags() == [(1, [1, 2], "followed")]
    for epoch in range(4, 9):
        assisted.service.feed(epoch, {A: {1: SMALL, 2: SMALL}, B: {1: LARGE}})
    assert (await post_corrections(assisted, at(expected + round(0.4 * FPS)), object=2))[1]["flags"] == [1]
    assert await flags() == [(1, [1, 2], "answered")]
    async with assisted.session.get("/metrics") as answer:
        lines = (await answer.text()).splitlines()
    for line in (
        'myview_flags_total{state="raised"} 1.0',
        'myview_flags_total{state="answered"} 1.0',
        'myview_flags_total{state="expired"} 0.0',
        "myview_flags_open 0.0",
        "myview_position_corrections_total 2.0",
    ):
        assert line in lines


def test_the_inbox_accepts_corrections_for_its_own_run_and_keeps_only_the_newest(
    caplog: pytest.LogCaptureFixture,
) -> None:
    inbox = CorrectionInbox("c0", boot=2)
    point = {"track": 1, "x": 1.0, "y": 2.0, "tolerance": 3.0}

    def receive(content: Any) -> None:
        payload = content if isinstance(content, bytes) else msgspec.msgpack.encode(content)
        inbox.put(Message("myview/hall/camera/c0/position_corrections", payload, b""))

    receive({"boot": 1, "corrections": [{"pulse": 1, **point}]})
    for first in (0, 200):
        receive({"boot": 2, "corrections": [{"pulse": first + number, **point} for number in range(200)]})
    precise = {"boot": 2, "corrections": [{"pulse": 1, **point, "tolerance": 1e-200}]}
    for bad in (
        b"",
        b"\x91" * 100_000,  # lists in lists
        {},
        {"boot": 2, "corrections": [{"pulse": -1, **point}]},
        precise,
    ):
        receive(bad)
    assert inbox.bad_messages == 5
    receive({})
    assert len(caplog.messages) == 5, "one for each reason"
    assert [correction.frame for correction in inbox.take()] == list(range(400 - 256, 400))
    assert inbox.take() == []
