"""Operators add, rename and remove cameras in the configuration; nobody else does; no password comes back."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Iterator
from contextlib import aclosing
from pathlib import Path
from typing import Any
from unittest.mock import ANY

import numpy as np
import pytest
from aiohttp import web

from fakes.http.tokens import bearer, serve_with_tokens
from fakes.media.rtsp_camera import RtspCamera
from fakes.service.fed_site import ServedSite, serve_site
from fakes.service.scripted_cameras import FPS, HEIGHT, WIDTH, encoded
from fakes.setup.onvif_camera import FakeProfile, OnvifCamera, onvif_cameras
from server.camera.encoder import Encoder
from server.config.camera_password import fill_in_password
from server.config.loader import load_config
from server.config.sections import EncodeSettings, SiteSettings
from server.http.access.csrf import CSRF_HEADER
from server.http.app_keys import SiteControl
from server.http.operator.trials import CameraTrials
from server.setup.camera_address import parse_address
from server.setup.trial_messages import StreamRequest, StreamTrial, try_stream

PATH = "/api/operator/site_cameras"
LOGIN = ("viewer", "p@ss:/w0rd")
TEXT = "cameras: [{id: c0, source: 'rtsp://viewer:hidden@10.0.0.1/'}, {id: c1, source: 'scene:room'}]\n"


def listed(camera: str, address: str, substream: str = "") -> dict[str, Any]:
    return {"camera": camera, "address": address, "substream": substream, "digest": ANY}


BEFORE = [listed("c0", "rtsp://10.0.0.1/..."), listed("c1", "scene:room")]
CHANGES = {CSRF_HEADER: "1"}
REMOVE = {"camera": "c0"}


@pytest.fixture
def stream() -> Iterator[RtspCamera]:
    units = encoded(0, 40)
    camera = RtspCamera([units[at : at + 5] for at in range(0, 40, 5)], FPS, login=LOGIN, live=True)
    yield camera
    camera.close()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "site.yaml"
    path.write_text(TEXT)
    return path


@pytest.fixture
async def site(path: Path) -> AsyncIterator[ServedSite]:
    async with aclosing(serve_site(patience=120, control=SiteControl(path))) as sites:
        yield await anext(sites)


async def send(
    site: ServedSite, method: str, body: Any, headers: dict[str, str] = CHANGES, path: str = PATH
) -> tuple[int, dict[str, Any]]:
    """Send a request, and follow the trial that it may have begun."""
    async with site.session.request(method, path, json=body, headers=headers) as answer:
        status, content = answer.status, json.loads(await answer.text())
    while status == 202:
        place = f"/api/operator/setup/trials/{content['trial']}"
        async with site.session.get(place, headers=headers) as answer:
            status, content = answer.status, json.loads(await answer.text())
    return status, content


async def test_a_camera_is_tried_added_renamed_and_removed(site: ServedSite, stream: RtspCamera) -> None:
    assert await site.get_json(PATH) == {"cameras": BEFORE, "note": ""}
    wanted = {"address": stream.url, "user": LOGIN[0], "password": LOGIN[1], "name": "Front door"}
    shown = stream.url.replace("live", "...")
    assert await send(site, "POST", wanted) == (
        200,
        {"cameras": [*BEFORE, listed("Front-door", shown)], "note": ""},
    )
    assert await send(site, "PUT", {"camera": "Front-door", "name": "door"}) == (
        200,
        {"cameras": [*BEFORE, listed("door", shown)], "note": ""},
    )
    assert await send(site, "DELETE", {"camera": "door"}) == (200, {"cameras": BEFORE, "note": ""})


async def test_a_camera_gets_the_address_of_one_that_was_tried(site: ServedSite, stream: RtspCamera) -> None:
    wanted = {"address": stream.url, "user": LOGIN[0], "password": LOGIN[1], "camera": "c0"}
    shown = stream.url.replace("live", "...")
    assert await send(site, "POST", wanted) == (
        200,
        {"cameras": [listed("c0", shown), BEFORE[1]], "note": ""},
    )
    assert await send(site, "POST", {**wanted, "camera": "c7"}) == (409, {"error": "there is no camera 'c7'"})


async def test_a_change_of_a_camera_that_others_have_changed_meanwhile_is_refused(
    site: ServedSite, stream: RtspCamera, path: Path
) -> None:
    c0, c1 = (camera["digest"] for camera in (await site.get_json(PATH))["cameras"])
    changed = TEXT.replace("hidden", "other")  # nothing that is shown
    path.write_text(changed)
    wanted = {"address": "rtsp://127.0.0.1:9/", "camera": "c0", "digest": c0}
    refusal = {"error": "camera c0 was changed in the configuration meanwhile: look, and try again"}
    assert await send(site, "POST", wanted) == (409, refusal), "before it is tried"
    assert await send(site, "PUT", {"camera": "c0", "name": "door", "digest": c0}) == (409, refusal)
    assert await send(site, "DELETE", {"camera": "c0", "digest": c0}) == (409, refusal)
    assert path.read_text() == changed
    assert (await send(site, "PUT", {"camera": "c1", "name": "hall", "digest": c1}))[0] == 200
    status, answer = await send(site, "DELETE", {"camera": "c1", "digest": c1})
    assert (status, answer["error"]) == (409, "there is no camera 'c1': it was renamed or removed meanwhile")
    now = (await site.get_json(PATH))["cameras"][0]["digest"]
    login = {"user": LOGIN[0], "password": LOGIN[1]}
    assert (await send(site, "POST", {"address": stream.url, **login, "camera": "c0", "digest": now}))[
        0
    ] == 200


async def test_what_is_in_pixels_follows_the_pictures_that_were_tried(
    site: ServedSite, stream: RtspCamera, path: Path
) -> None:
    path.write_text(f"{TEXT}zones: [{{id: till, camera: c0, area: [[0, 0], [40, 0], [40, 30]]}}]\n")
    size = 2 * WIDTH, 2 * HEIGHT
    encoder = Encoder(SiteSettings(width=size[0], height=size[1], fps=FPS), EncodeSettings(gop_s=5 / FPS))
    blank = np.zeros((*size[::-1], 3), dtype=np.uint8)
    units = [encoder.encode(pulse, blank) for pulse in range(40)]
    larger = RtspCamera([units[at : at + 5] for at in range(0, 40, 5)], FPS, live=True)
    login = {"user": LOGIN[0], "password": LOGIN[1]}
    try:
        _, first = await send(site, "POST", {"address": stream.url, **login, "camera": "c0"})
        assert first["note"] == "the size of its earlier picture is not known: check its zone till"
        _, second = await send(site, "POST", {"address": larger.url, "camera": "c0"})
    finally:
        larger.close()
    assert second["note"] == "scaled from 64x48 to 128x96: its zone till"
    assert load_config(path).zones[0].area == [(0, 0), (80, 0), (80, 60)]


async def test_a_trial_that_waits_for_others_says_for_how_many(
    site: ServedSite, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def ask(place: str, body: Any = None) -> tuple[int, dict[str, Any]]:
        method = "GET" if body is None else "POST"
        async with site.session.request(method, place, json=body, headers=CHANGES) as answer:
            return answer.status, json.loads(await answer.text())

    may_go_on = asyncio.Event()

    async def try_later(request: StreamRequest) -> StreamTrial:
        await may_go_on.wait()
        return await try_stream(request)

    monkeypatch.setattr("server.setup.session.try_stream", try_later)
    bodies = [{"address": f"rtsp://127.0.0.1:{port}/"} for port in (1, 2, 3)]
    answers = await asyncio.gather(*(ask(PATH, body) for body in bodies))
    trials = [f"/api/operator/setup/trials/{answer['trial']}" for _, answer in answers]
    while sorted(answer["ahead"] for _, answer in answers) != [0, 0, 1]:  # one may not be in the queue yet
        answers = await asyncio.gather(*map(ask, trials))
    assert {status for status, _ in answers} == {202}
    may_go_on.set()
    for trial in trials:
        while (answer := await ask(trial))[0] == 202:
            pass
        status, result = answer
        assert status == 400
        assert result["error"].startswith("rtsp://127.0.0.1:")
    assert (await ask("/api/operator/setup/trials/999999999"))[0] == 404
    assert path.read_text() == TEXT


async def test_a_trial_that_fails_unexpectedly_ends_with_an_error_that_is_not_asked_for_again(
    site: ServedSite, path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def fail(_: StreamRequest) -> StreamTrial:
        raise RuntimeError("unexpected")

    monkeypatch.setattr("server.setup.session.try_stream", fail)
    body = {"address": "rtsp://127.0.0.1:1/"}
    assert await send(site, "POST", body) == (409, {"error": "the trial failed: see the service's log"})
    (logged,) = [record for record in caplog.records if record.exc_info]
    assert logged.getMessage() == "a trial of a camera failed"
    assert path.read_text() == TEXT


async def test_a_service_that_starts_again_has_other_keys_of_trials() -> None:
    async def work() -> web.Response:
        return web.Response()

    keys = [CameraTrials().start(work()) for _ in range(8)]
    assert len(set(keys)) == 8
    assert max(keys) < 1_000_000_000, "the route has nine digits"


@pytest.mark.parametrize(
    ("width", "error"),
    [
        (WIDTH, None),
        (128, "passthrough: pass: its frames are 64x48, the site's 128x48 (site.width, site.height)"),
    ],
)
async def test_a_camera_that_is_passed_through_gets_no_address_whose_video_does_not_fit(
    site: ServedSite, stream: RtspCamera, path: Path, width: int, error: str | None
) -> None:
    text = f"""\
site: {{width: {width}, height: {HEIGHT}, fps: {FPS}}}
encode: {{gop_s: 0.2}}
cameras: [{{id: c0, source: 'rtsp://10.0.0.1/', passthrough: pass}}]
"""
    path.write_text(text)
    wanted = {"address": stream.url, "user": LOGIN[0], "password": LOGIN[1], "camera": "c0"}
    status, answer = await send(site, "POST", wanted)
    if error is None:
        assert (status, load_config(path).camera("c0").passthrough) == (200, "pass")
        return
    shown = stream.url.replace("live", "...")
    advice = "change the camera's settings, or let it be encoded (passthrough: auto)"
    assert (status, answer) == (400, {"error": f"{shown}: {error}; {advice}"})
    assert path.read_text() == text
    assert (await send(site, "POST", {**wanted, "camera": ""}))[0] == 200  # a new one is encoded


async def test_a_camera_is_added_with_a_substream_that_is_tried_too(
    site: ServedSite, stream: RtspCamera, path: Path
) -> None:
    wanted = {"address": f"{stream.url}/1", "user": LOGIN[0], "password": LOGIN[1], "name": "door"}
    status, answer = await send(site, "POST", {**wanted, "substream_address": "rtsp://127.0.0.1:9/live"})
    assert (status, answer["error"][:14]) == (400, "the substream:")
    assert path.read_text() == TEXT
    status, answer = await send(site, "POST", {**wanted, "substream_address": f"{stream.url}/2"})
    shown = stream.url.replace("live", "...")
    assert (status, answer["cameras"]) == (200, [*BEFORE, listed("door", shown, shown)])
    camera = fill_in_password(load_config(path), "door").camera("door")
    assert camera.substream == parse_address(f"{stream.url}/2", *LOGIN).with_password


async def test_a_camera_that_is_found_is_added_with_two_of_its_streams(
    site: ServedSite, stream: RtspCamera, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("onvif", reason="needs onvif-zeep-async: the extra onvif")
    profiles = [
        FakeProfile("main", f"{stream.url}/1", 1920, 1080, 25),
        FakeProfile("sub", f"{stream.url}/2", 640, 360, 25),
    ]
    with onvif_cameras(OnvifCamera("door", profiles, LOGIN)) as targets:
        monkeypatch.setenv("MYVIEW_DISCOVERY", targets)
        _, answer = await send(site, "POST", None, path="/api/operator/setup/search")
        (found,) = answer["cameras"]
        login = {"user": LOGIN[0], "password": LOGIN[1]}
        asked = {"host": found["host"], "port": found["port"], **login}
        _, offered = await send(site, "POST", asked, path="/api/operator/setup/streams")
    wanted = {"stream": offered["source"], "substream": offered["substream"], "camera": "c0"}
    status, answer = await send(site, "POST", wanted)
    shown = stream.url.replace("live", "...")
    assert (status, answer["cameras"]) == (200, [listed("c0", shown, shown), BEFORE[1]])
    assert LOGIN[1] not in path.read_text()
    assert (await send(site, "POST", {**wanted, "stream": 99}))[0] == 400


async def test_the_wizards_other_requests_are_not_served_by_a_site(site: ServedSite, path: Path) -> None:
    for place, body in (("cameras", {}), ("site", {"name": "x", "fps": 5, "width": 64, "height": 48})):
        assert (await send(site, "POST", body, path=f"/api/operator/setup/{place}"))[0] == 404
    assert path.read_text() == TEXT


async def test_a_camera_that_sends_no_pictures_is_not_added(
    site: ServedSite, stream: RtspCamera, path: Path
) -> None:
    status, answer = await send(site, "POST", {"address": stream.url, "user": LOGIN[0], "password": "wr0ng"})
    assert status == 400
    assert "401" in answer["error"]
    assert "wr0ng" not in answer["error"]
    assert path.read_text() == TEXT


@pytest.mark.parametrize(
    ("method", "body", "status"),
    [
        ("POST", {"address": "file:///etc/passwd"}, 400),
        ("POST", {"address": "/etc/passwd"}, 400),
        ("POST", {"address": "x" * 1001}, 400),
        ("POST", {"address": "rtsp://h/", "password": "x" * 201}, 400),
        ("POST", {"address": "rtsp://h/", "more": 1}, 400),
        ("POST", {}, 400),
        ("PUT", {"camera": "c0", "name": "../c0"}, 409),
        ("PUT", {"camera": "c0", "name": "c1"}, 409),
        ("PUT", {"camera": "c0", "name": "x" * 101}, 400),
        ("PUT", {"camera": "c7", "name": "front"}, 409),
        ("DELETE", {"camera": "c7"}, 409),
        ("DELETE", {"camera": 1}, 400),
        ("DELETE", [], 400),
    ],
)
async def test_an_invalid_request_is_one_line_and_changes_nothing(
    site: ServedSite, path: Path, method: str, body: Any, status: int
) -> None:
    code, answer = await send(site, method, body)
    assert code == status
    assert len(answer["error"].splitlines()) == 1
    assert [file.name for file in path.parent.iterdir()] == ["site.yaml"]
    assert path.read_text() == TEXT


async def test_a_change_needs_the_header_that_no_other_site_can_send(site: ServedSite, path: Path) -> None:
    for method in ("POST", "PUT", "DELETE"):
        assert (await send(site, method, REMOVE, {}))[0] == 403
    assert path.read_text() == TEXT


async def test_only_operators_see_or_change_the_configured_cameras(path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "tokens"
    folder.mkdir()
    async with serve_with_tokens(folder, control=SiteControl(path)) as site:
        for token in ("desk", "family", "door"):
            for method in ("GET", "POST", "PUT", "DELETE"):
                assert (await send(site, method, REMOVE, {**CHANGES, **bearer(token)}))[0] == 403
            for name in ("search", "streams"):
                place = f"/api/operator/setup/{name}"
                assert (await send(site, "POST", {}, {**CHANGES, **bearer(token)}, place))[0] == 403
        assert (await send(site, "DELETE", REMOVE))[0] == 401
        assert path.read_text() == TEXT
        assert await send(site, "DELETE", REMOVE, {**CHANGES, **bearer("lead")}) == (
            200,
            {"cameras": BEFORE[1:], "note": ""},
        )


async def test_a_service_without_a_configuration_file_says_so() -> None:
    async with aclosing(serve_site(control=SiteControl())) as sites:
        site = await anext(sites)
        assert (await site.get(PATH))[0] == 409
        for method, body in (
            ("POST", {"address": "rtsp://127.0.0.1/"}),
            ("PUT", {"camera": "c0", "name": "front"}),
            ("DELETE", REMOVE),
        ):
            assert await send(site, method, body) == (
                409,
                {"error": "this service has no configuration file"},
            )
