"""The operator points at somebody: what the server takes, what it says, and what the camera is told."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import aclosing
from typing import Any

import msgspec
import pytest

from fakes.service.fed_site import A, B, Hall, opened, see
from fakes.service.scripted_cameras import FPS, HEIGHT, LARGE, SMALL, STRIDE, WIDTH, tracks, word
from server.camera.operator_corrections import CorrectionInbox
from server.http.access.csrf import CSRF_HEADER
from server.messaging.inbox import Message
from server.messaging.operator_messages import PositionCorrections, RiskEvent

POINTING = "/api/operator/pointing"


@pytest.fixture
async def helped() -> AsyncIterator[Hall]:
    """Serve a site whose cameras take pointings: object 1 in both, 2 in c0 alone."""
    async with aclosing(opened(track={"assist": {"enabled": True, "memory_frames": 10}})) as halls:
        hall = await anext(halls)
        see(hall)
        yield hall


def sent(hall: Hall) -> list[tuple[str, PositionCorrections]]:
    """Collect what cameras are told from now on."""
    told: list[tuple[str, PositionCorrections]] = []

    def send(camera: str, payload: bytes) -> None:
        told.append((camera, msgspec.json.decode(payload, type=PositionCorrections)))

    hall.service.assist._send = send
    return told


async def say(hall: Hall, *points: Any, **said: Any) -> tuple[int, Any]:
    body = {"object": 1, "camera": A, "points": list(points), **said}
    async with hall.session.post(POINTING, headers={CSRF_HEADER: "1"}, json=body) as answer:
        return answer.status, await answer.json()


def at(pulse: int, x: float = 12.0, y: float = 20.0, **more: float) -> dict[str, float]:
    return {"pulse": pulse, "x": x, "y": y, **more}


async def test_the_camera_is_told_by_its_own_track(helped: Hall) -> None:
    told = sent(helped)
    status, answer = await say(helped, at(2), at(7, tolerance=3.0), object=2)
    assert (status, answer["accepted"], answer["too_old"], answer["flags"]) == (200, 2, 0, [])
    [(camera, said)] = told
    assert (camera, said.boot) == (A, 1)
    assert [(it.pulse, it.track, it.x, it.y) for it in said.corrections] == [(2, 2, 12, 20), (7, 2, 12, 20)]
    assert [it.tolerance for it in said.corrections] == [pytest.approx(0.02 * WIDTH), 3.0]
    status, answer = await say(helped, at(7), camera=B)
    assert (status, answer["accepted"]) == (200, 1)
    assert told[1][0] == B
    assert (await say(helped, at(7, tolerance=1e-200)))[0] == 200
    assert told[2][1].corrections[0].tolerance == 1.0, (
        "nobody points better than a pixel, and squares of this are 0"
    )


async def test_what_is_too_long_ago_is_left_out_and_said(helped: Hall) -> None:
    for epoch in range(3, 9):
        helped.service.feed(epoch, {A: {1: SMALL, 2: SMALL}, B: {1: LARGE}})
    told = sent(helped)
    status, answer = await say(helped, at(2), at(30))
    assert (status, answer["accepted"], answer["too_old"]) == (200, 1, 1)
    assert [it.pulse for it in told[0][1].corrections] == [30]
    assert (await say(helped, at(2)))[0] == 409
    assert len(told) == 1


@pytest.mark.parametrize(
    ("said", "status", "why"),
    [
        ({"object": 9}, 404, "there is no object 9"),
        ({"camera": "c9"}, 404, "there is no camera 'c9'"),
        ({"object": 2, "camera": B}, 409, "camera c1 did not show object 2"),
        ({"points": []}, 400, "length >= 1"),
        ({"points": [at(1)] * 257}, 400, "length <= 256"),
        ({"points": [at(1, x=WIDTH + 1)]}, 400, f"is not in a picture of {WIDTH}x{HEIGHT}"),
        ({"points": [at(1, y=-1)]}, 400, "is not in a picture"),
        ({"points": [at(999)]}, 400, "pulse 999 has not come yet"),
        ({"points": [at(1, tolerance=0)]}, 400, "> 0"),
        ({"points": [{"pulse": -1, "x": 1, "y": 1}]}, 400, ">= 0"),
        ({"who": 1}, 400, "unknown field"),
    ],
    ids=str,
)
async def test_what_makes_no_sense_is_refused_in_a_line(
    helped: Hall, said: dict[str, Any], status: int, why: str
) -> None:
    told = sent(helped)
    code, answer = await say(helped, at(7), **said)
    assert code == status
    assert why in answer["error"]
    assert "\n" not in answer["error"]
    assert told == []


async def test_another_sites_page_cannot_point(helped: Hall) -> None:
    body = {"object": 1, "camera": A, "points": [at(7)]}
    async with helped.session.post(POINTING, json=body) as answer:
        assert answer.status == 403


async def test_where_no_camera_takes_it_that_is_said(busy: Hall) -> None:
    status, answer = await say(busy, at(7))
    assert (status, answer["error"]) == (409, "cameras take no corrections: track.assist.enabled is off")
    assert (await busy.get_json(POINTING))["unavailable"] == answer["error"]


async def test_a_flag_is_raised_followed_answered_and_counted(helped: Hall) -> None:
    expected = 4 * STRIDE
    trouble = RiskEvent(reason="crossing", tracks=[1, 2], pulse=expected, margin=0.1, risk=0.5)
    nobody = [RiskEvent(reason="optimality_gap", tracks=[], pulse=17, margin=0.0, risk=0.5)]
    nobody += [RiskEvent(reason="track_loss", tracks=[77], pulse=17, margin=0.0, risk=0.5)]
    helped.service.ingest.tracks(tracks(word(A, 3, {1: SMALL, 2: SMALL}, risk_events=[*nobody, trouble])))
    helped.service.ingest.tracks(tracks(word(B, 3, {1: LARGE})))
    helped.service.pulse = 4 * STRIDE - 1
    helped.service.decide()

    async def flags() -> list[Any]:
        return [
            (it["id"], it["objects"], it["state"]) for it in (await helped.get_json("/api/flags"))["flags"]
        ]

    assert await flags() == [(1, [1, 2], "raised")]
    assert (await say(helped, at(7)))[1]["flags"] == [1]
    assert await flags() == [(1, [1, 2], "followed")]
    for epoch in range(4, 9):
        helped.service.feed(epoch, {A: {1: SMALL, 2: SMALL}, B: {1: LARGE}})
    assert (await say(helped, at(expected + round(0.4 * FPS)), object=2))[1]["flags"] == [1]
    assert await flags() == [(1, [1, 2], "answered")]
    async with helped.session.get("/metrics") as answer:
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

    def hear(content: Any) -> None:
        payload = content if isinstance(content, bytes) else msgspec.json.encode(content)
        inbox.put(Message("myview/hall/camera/c0/position_corrections", payload, b""))

    hear({"boot": 1, "corrections": [{"pulse": 1, **point}]})
    for first in (0, 200):
        hear({"boot": 2, "corrections": [{"pulse": first + it, **point} for it in range(200)]})
    sharp = {"boot": 2, "corrections": [{"pulse": 1, **point, "tolerance": 1e-200}]}
    for bad in (b"", b"[" * 100_000, b"{}", {"boot": 2, "corrections": [{"pulse": -1, **point}]}, sharp):
        hear(bad)
    assert inbox.bad_messages == 5
    hear(b"{}")
    assert len(caplog.messages) == 5, "one for each reason"
    assert [it.frame for it in inbox.take()] == list(range(400 - 256, 400))
    assert inbox.take() == []
