"""`myview status` shows a site's status, once or live."""

from __future__ import annotations

import asyncio
import json
import re
from pathlib import Path
from typing import Any

import msgspec
import pytest
from aiohttp import web
from aiohttp.test_utils import TestServer
from rich.console import Console

import client
from client.status.prometheus_text import Metrics, service_of
from fakes.cli.command_line import RunCommand
from fakes.http.tokens import serve_with_tokens, token_of
from fakes.service.fed_site import A, B, ServedSite, show_people
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    camera_tracks,
    lost_source,
    small_config,
    status,
    tracks,
)
from fakes.timeouts import PATIENCE
from server.cli.status import command
from server.cli.status.command import status_live, status_once
from server.cli.status.display import ServiceRates, render_status
from server.config.sections import HttpSettings
from server.http.app import make_app, serving
from server.messaging.messages import SolverReport
from server.service.pipeline import BestViewPipeline
from server.service.service import BestViewService
from server.system.errors import UnavailableError, UserError


def url(served: ServedSite) -> str:
    return f"http://127.0.0.1:{served.port}"


def printed(now: client.SiteNow, rates: ServiceRates = ServiceRates(), notice: str = "") -> str:  # noqa: B008 — frozen
    console = Console(width=200, record=True, file=None)
    with console.capture() as output:
        console.print(render_status(now, rates, notice))
    return output.get()


async def test_a_sites_status_is_shown(site_with_people: ServedSite) -> None:
    solve = SolverReport(objective=-4.0, bound=-4.0, gap=0.0, integral=True, rounds=1)
    site_with_people.service.ingest.receive_status(
        status(A, fps=24.5, missed=3, shed=2, waiting=7, synchronized=False)
    )
    site_with_people.service.ingest.receive_tracks(
        tracks(camera_tracks(A, 2, {}, solve=solve, solved_at=0.25))
    )
    site_with_people.service.decider.people.registry.names[1] = "Ann"
    now = await client.status(url(site_with_people))
    assert (now.name, now.ready, now.why, now.pulse) == ("hall", True, "2 of 2 cameras", 14)
    one, two = now.cameras
    assert (one.camera, one.state, one.fps, one.missed, one.shed, one.waiting) == (A, "live", 24.5, 3, 2, 7)
    assert (one.optimal, one.tracking_delay_s, one.synchronized) == (1.0, 0.25, False)
    assert (two.camera, two.optimal, two.waiting) == (B, None, None)
    ann, other = now.people
    assert (ann.name, ann.camera, ann.cameras, ann.since_s) == ("Ann", B, (A, B), 10 / FPS)
    assert other.camera == A
    assert now.service is not None
    assert now.service.viewers["object"] == 0
    assert now.service.decided_pulse == site_with_people.service.decision_state.end
    text = printed(now)
    assert "hall  " in text
    assert "ready" in text
    assert next(line for line in text.splitlines() if line.startswith(A)).split()[:3] == [A, "live", "24.5"]
    assert "not synchronized" in text
    assert "1 Ann" in text
    assert "not recording" in text


async def test_a_site_that_is_not_ready_exits_with_1_and_the_reason(
    served: ServedSite, capsys: pytest.CaptureFixture[str]
) -> None:
    assert not await status_once(url(served), None, as_json=False)
    output = capsys.readouterr().out
    assert "not ready: " in output
    assert "no camera delivers frames" in output
    assert "no people yet" in output
    show_people(served)
    assert await status_once(url(served), None, as_json=True)
    content = json.loads(capsys.readouterr().out)
    assert msgspec.convert(content, client.SiteNow).ready
    assert [camera["camera"] for camera in content["cameras"]] == list(CAMERAS)


async def test_a_token_for_one_camera_shows_only_it_and_no_metrics(tmp_path: Path) -> None:
    async with serve_with_tokens(tmp_path) as served:
        show_people(served)
        now = await client.status(url(served), client.HttpSettings(token=token_of("door")))
        assert (now.service, now.pulse, now.ready) == (None, None, True)
        assert [(camera.camera, camera.optimal) for camera in now.cameras] == [(A, None)]
        assert "viewers" not in printed(now)
        assert (
            await client.status(url(served), client.HttpSettings(token=token_of("desk")))
        ).service is not None
        with pytest.raises(UserError, match="MYVIEW_TOKEN"):
            await status_once(url(served), None, as_json=False)


async def test_a_lost_camera_says_why_and_when_it_is_opened_again(site_with_people: ServedSite) -> None:
    lost = lost_source("Connection refused", 3600.0)
    site_with_people.service.ingest.receive_status(status(A, state="away", unavailable=lost))
    output = " ".join(printed(await client.status(url(site_with_people))).split())
    line = (
        rf"{A}: its source delivers no frames: Connection refused; it is opened again at \d\d:\d\d:\d\d UTC"
    )
    assert re.search(line, output)


async def test_no_text_of_the_server_controls_the_terminal(site_with_people: ServedSite) -> None:
    now = await client.status(url(site_with_people))
    evil = "\x1b[2J\x1b]0;owned\x07\nnew [red]line"
    camera = msgspec.structs.replace(now.cameras[0], message=evil, state=evil, camera=evil)
    person = msgspec.structs.replace(now.people[0], name=evil, camera=evil, cameras=(evil,))
    output = printed(
        msgspec.structs.replace(now, name=evil, ready=False, why=evil, cameras=(camera,), people=(person,)),
        notice=evil,
    )
    assert output.count("·[2J·]0;owned· new [red]line") == 10
    assert now.service is not None
    counted = msgspec.structs.replace(now.service, viewers={evil: 1}, waiting={evil: 2})
    output += printed(msgspec.structs.replace(now, service=counted))
    assert output.count("·[2J·]0;owned· new [red]line") == 12
    assert all(char.isprintable() or char == "\n" for char in output)


async def test_rates_are_between_two_snapshots_of_one_run(site_with_people: ServedSite) -> None:
    one = await client.status(url(site_with_people))
    assert one.service is not None
    later = msgspec.structs.replace(
        one.service, cpu_s=one.service.cpu_s + 1.0, sent_bytes=one.service.sent_bytes + 500
    )
    two = msgspec.structs.replace(one, now=one.now + 2.0, service=later)
    assert ServiceRates.between(one, two) == ServiceRates(pytest.approx(0.5), pytest.approx(250.0))
    assert "0.50 cores" in printed(two, ServiceRates.between(one, two))
    for other in (None, two, msgspec.structs.replace(one, service=None)):
        assert ServiceRates.between(other, one) == ServiceRates()
    restarted = msgspec.structs.replace(two, service=msgspec.structs.replace(later, began=1.0))
    assert ServiceRates.between(one, restarted) == ServiceRates()


async def test_an_unreachable_server_is_retried(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "_EVERY_S", 0.01)
    output: list[Any] = []

    async def until(met: Any) -> None:
        while not any(met(line) for line in output):
            await asyncio.sleep(0.01)
            output.extend(map(json.loads, capsys.readouterr().out.splitlines()))

    async with asyncio.timeout(PATIENCE):
        async with serving(
            make_app(BestViewService(BestViewPipeline(small_config()))), HttpSettings(port=0)
        ) as port:
            live = asyncio.create_task(status_live(f"http://127.0.0.1:{port}", None, as_json=True))
            await until(lambda status: status.get("name") == "hall")
        await until(lambda status: "away" in status)
        output.clear()
        async with serving(
            make_app(BestViewService(BestViewPipeline(small_config()))), HttpSettings(port=port)
        ):
            await until(lambda status: status.get("name") == "hall")
            live.cancel()
            with pytest.raises(asyncio.CancelledError):
                await live


async def test_the_display_shows_an_unreachable_and_a_restarted_server(
    site_with_people: ServedSite, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = await client.status(url(site_with_people))
    assert now.service is not None
    other = msgspec.structs.replace(now, service=msgspec.structs.replace(now.service, began=1.0))
    answers = iter([now, client.AwayError("hall: no answer"), other])

    async def answer(*_: Any) -> client.SiteNow:
        outcome = next(answers, None)
        if outcome is None:
            raise client.RefusedError("a token is needed")
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    monkeypatch.setattr(command, "_EVERY_S", 0.0)
    monkeypatch.setattr(command, "status", answer)
    monkeypatch.setattr(command, "Console", lambda: Console(force_terminal=True, width=200))
    with pytest.raises(UserError, match="a token is needed; --token, or MYVIEW_TOKEN"):
        await status_live("hall", None, as_json=False)
    output = capsys.readouterr().out
    assert "hall: no answer; trying again" in output
    assert output.index("trying again") < output.index("the service was restarted")


async def test_another_or_a_missing_server_is_reported_in_one_line(served: ServedSite) -> None:
    with pytest.raises(UserError, match="is not an address"):
        await status_once("ftp://hall", None, as_json=False)
    with pytest.raises(UnavailableError, match="status: http"):
        await status_once("http://127.0.0.1:9", None, as_json=False)
    with pytest.raises(UserError):
        await status_once(f"{url(served)}/api", None, as_json=False)


def test_values_that_are_not_finite_are_ignored() -> None:
    found = Metrics("myview_pulse +Inf\nmyview_decided_pulse NaN\nmyview_recorded_bytes 7\n")
    assert found.get("myview_pulse") is None
    assert (service_of(found).decided_pulse, service_of(found).recorded_bytes) == (0, 7)


@pytest.mark.parametrize("wrong", [{"fps": 0.0}, {"now": 1e300}])
async def test_an_invalid_site_is_reported_in_one_line(served: ServedSite, wrong: dict[str, float]) -> None:
    async def site(_: web.Request) -> web.Response:
        found_site = await client.site(url(served))
        return web.json_response({**msgspec.to_builtins(found_site), **wrong})

    app = web.Application()
    app.router.add_get("/api/site", site)
    async with TestServer(app) as server:
        with pytest.raises(UserError, match="does not answer like MyView"):
            await status_once(str(server.make_url("/")), None, as_json=False)


def test_the_command_refuses_in_one_line(myview: RunCommand) -> None:
    result = myview("status", "http://127.0.0.1:9", "--once")
    assert (result.code, result.out) == (3, "")
    assert result.err.startswith("myview: status: http://127.0.0.1:9")
    assert len(result.err.splitlines()) == 1
