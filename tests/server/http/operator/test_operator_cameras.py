"""The operator's view of cameras and pulses."""

from __future__ import annotations

import time
from contextlib import aclosing

import pytest

from camsync import Credentials, PulseClient, PulseServer
from fakes.service.fed_site import A, B, ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, lost_source, status, unavailable
from server.messaging.inbox import Message
from server.messaging.messages import ZenohKeys


async def test_every_camera_is_listed_with_its_measurements(site_with_people: ServedSite) -> None:
    site_with_people.service.ingest.receive_status(status(A, missed=3, shed=2, clock_offset=0.25))
    site_with_people.service.joint.offsets = {A: 0.12}
    answer = (await site_with_people.get_json("/api/operator/cameras"))["cameras"]
    plain = (await site_with_people.get_json("/api/cameras"))["cameras"]
    assert [camera["camera"] for camera in answer] == [A, B]
    for diagnostics, plain_info in zip(answer, plain, strict=True):
        assert diagnostics.items() >= plain_info.items()
    first = answer[0]
    assert (first["clock_offset"], answer[1]["clock_offset"]) == (0.25, None)
    assert (first["floor_offset"], answer[1]["floor_offset"]) == (0.12, None)
    assert first["sync_error"] == {"median": 0.0, "worst": 0.0}
    assert first["picture"] == {"width": 64, "height": 48, "scale": 1.0, "left": 0.0, "top": 0.0}
    assert (first["optimal"], first["solved_windows"], first["last_error"]) == (None, 0, None)


async def test_the_last_error_is_shown_until_the_next_one(site_with_people: ServedSite) -> None:
    async def trouble() -> str:
        camera = (await site_with_people.get_json("/api/operator/cameras"))["cameras"][0]
        return str(camera["last_error"]["text"])

    ingest = site_with_people.service.ingest
    ingest.receive_status(Message(ZenohKeys("hall").camera(A, "status"), b"{}", b""))
    assert "invalid message: " in await trouble()
    ingest.receive_status(status(A, state="away"))
    assert await trouble() == "its source delivers no frames"
    refused = lost_source("Connection refused", 10.0)
    ingest.receive_status(status(A, state="away", unavailable=refused))
    assert await trouble() == "rtsp://10.0.0.9/...: Connection refused"
    ingest.receive_status(status(A, state="live"))
    assert await trouble() == "rtsp://10.0.0.9/...: Connection refused"
    ingest.set_present(ZenohKeys("hall").camera(A, "alive"), is_present=False)
    assert await trouble() == "its process disconnected"


async def test_only_operators_see_why_a_camera_cannot_be_opened(site_with_people: ServedSite) -> None:
    """The reason may name an address in the cameras' network."""
    ingest, reason = site_with_people.service.ingest, "rtsp://10.0.0.9: Connection refused"
    ingest.set_present(ZenohKeys("hall").camera(A, "alive"), is_present=False)
    ingest.receive_unavailable(unavailable(A, "unopened", 10.0, reason))
    operators, viewers = [
        (await site_with_people.get_json(path))["cameras"][0]["message"]
        for path in ("/api/operator/cameras", "/api/cameras")
    ]
    assert (operators, viewers) == (reason, "its source cannot be opened")


async def test_everybody_sees_why_a_camera_is_lost_and_until_when_and_operators_where(
    site_with_people: ServedSite,
) -> None:
    """The camera says it each second; that its messages travel does not move the end of the pause."""

    async def shown() -> list[tuple[str, str, float | None]]:
        answers = [
            await site_with_people.get_json(path) for path in ("/api/cameras", "/api/operator/cameras")
        ]
        first = [answer["cameras"][0] for answer in answers]
        return [(camera["state"], camera["message"], camera["retry_at"]) for camera in first]

    ingest, began = site_with_people.service.ingest, time.time()
    ingest.receive_status(status(A, state="away", unavailable=lost_source("no answer within 5 s", 9.9)))
    (state, viewers, retry_at), (_, operators, operators_retry_at) = first = await shown()
    assert (state, viewers) == ("gone", "its source delivers no frames: no answer within 5 s")
    assert operators == "rtsp://10.0.0.9/...: no answer within 5 s"
    assert retry_at == operators_retry_at
    assert retry_at is not None
    assert began + 9.9 <= retry_at <= time.time() + 9.9
    ingest.receive_status(
        status(A, state="away", unavailable=lost_source("no answer within 5 s", retry_at - time.time() + 0.1))
    )
    assert await shown() == first
    async with site_with_people.session.get("/metrics") as answer:
        assert f'myview_camera_retry_seconds{{camera="{A}",cause="lost"}} ' in await answer.text()
    ingest.receive_status(status(A, state="away", unavailable=lost_source("no answer within 5 s", 0.0)))
    assert [at for _, _, at in await shown()] == [None, None], "it is being connected"
    ingest.receive_status(status(A))
    assert await shown() == [("live", "", None)] * 2
    ingest.receive_status(status(A, state="away", unavailable=lost_source("Connection refused", 5.0)))
    ingest.set_present(ZenohKeys("hall").camera(A, "alive"), is_present=False)
    assert await shown() == [("gone", "", None)] * 2, "its process, which said it, is gone"


async def test_a_camera_that_waits_to_be_opened_again_says_until_when(site_with_people: ServedSite) -> None:
    async def retry_at() -> float | None:
        camera = (await site_with_people.get_json("/api/operator/cameras"))["cameras"][0]
        return None if camera["retry_at"] is None else float(camera["retry_at"])

    async def exported(metric: str) -> list[str]:
        async with site_with_people.session.get("/metrics") as answer:
            lines = (await answer.text()).splitlines()
        return [line for line in lines if line.startswith(f"{metric}{{")]

    ingest = site_with_people.service.ingest
    assert await retry_at() is None
    assert not await exported("myview_camera_retry_seconds")
    for change in (1, 2):
        ingest.set_present(ZenohKeys("hall").camera(A, "alive"), is_present=False)
        for pause_s in (50.0, 40.0):  # it is told again, to a service that has connected
            began = time.time()
            ingest.receive_unavailable(unavailable(A, "changed", pause_s, "its images are small"))
            until = await retry_at()
            assert until is not None
            assert began + pause_s <= until <= time.time() + pause_s
        (line,) = await exported("myview_camera_retry_seconds")
        assert line.startswith(f'myview_camera_retry_seconds{{camera="{A}",cause="changed"}} ')
        assert 0 < float(line.split()[1]) <= 40
        assert f'{{camera="{A}"}} {change}.0' in (await exported("myview_camera_stream_changes_total"))[0]
        ingest.receive_unavailable(unavailable(A, "changed", 0.0, "its images are small"))
        assert await retry_at() is None, "it is being opened"
        ingest.set_present(ZenohKeys("hall").camera(A, "alive"), is_present=True)
        assert not await exported("myview_camera_retry_seconds")


async def test_the_floor_shows_calibrated_cameras_whose_size_is_known() -> None:
    plan = [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 1.0]]
    cameras = [{"id": A, "source": "scene:room", "ground": plan}, B]
    async with aclosing(serve_site(cameras=cameras)) as sites:
        served = await anext(sites)
        assert await served.get_json("/api/operator/floor") == {"cameras": [], "uncalibrated": [B]}
        served.service.connect_cameras(*CAMERAS)
        served.service.feed(0, {A: {}, B: {}})
        (camera,) = (await served.get_json("/api/operator/floor"))["cameras"]
    assert camera["camera"] == A
    assert camera["homography"] == plan
    corners = [round(side, 6) for corner in camera["outline"] for side in corner]
    assert corners == [0.0, 4.8, 6.4, 4.8, 6.4, 0.0, 0.0, 0.0]


async def test_the_pulse_servers_clients_and_missing_ones_are_listed() -> None:
    async with (
        PulseServer(25.0) as server,
        PulseClient("127.0.0.1", server.port, A) as camera,
        PulseClient("127.0.0.1", server.port, "stranger") as stranger,
        aclosing(serve_site(sync={"port": server.port})) as sites,
    ):
        for client in (camera, stranger):
            await anext(aiter(client))  # it is connected
        answer = await (await anext(sites)).get_json("/api/operator/pulses")
        assert (answer["server"], answer["error"]) == (f"127.0.0.1:{server.port}", "")
    assert {(client["name"], client["expected"], client["behind"]) for client in answer["clients"]} == {
        (A, True, 0),
        ("stranger", False, 0),
    }
    assert answer["missing"] == [B, "bestview"]


async def test_a_pulse_server_with_passwords_lists_its_clients_to_the_service() -> None:
    users = {A: "a" * 32, "bestview": "b" * 32}
    async with (
        PulseServer(25.0, users=users) as server,
        PulseClient("127.0.0.1", server.port, A, credentials=Credentials(A, users[A])) as camera,
        aclosing(serve_site(sync={"port": server.port})) as sites,
    ):
        await anext(aiter(camera))
        served = await anext(sites)
        assert "needs a login" in (await served.get_json("/api/operator/pulses"))["error"]
        served.service.pulses.credentials = Credentials("bestview", users["bestview"])
        answer = await served.get_json("/api/operator/pulses")
    assert (answer["error"], [client["name"] for client in answer["clients"]]) == ("", [A])
    assert answer["missing"] == [B, "bestview"]


@pytest.mark.parametrize("port", [1])
async def test_an_unreachable_pulse_server_is_reported_in_one_line(port: int) -> None:
    async with aclosing(serve_site(sync={"port": port})) as sites:
        answer = await (await anext(sites)).get_json("/api/operator/pulses")
    assert answer["error"].startswith(f"there is no pulse server at 127.0.0.1:{port}")
    assert "\n" not in answer["error"]
