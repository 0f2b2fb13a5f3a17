"""The API: people, the cameras that show them, and the reasons."""

from __future__ import annotations

import math
import re

import pytest

from fakes.service.fed_site import A, B, ServedSite
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    GOP,
    HEIGHT,
    LARGE,
    SMALL,
    WIDTH,
    encoded,
    status,
    thumbnail,
    video,
)
from server.messaging.inbox import Inbox


async def test_the_site_is_described(site_with_people: ServedSite) -> None:
    site = await site_with_people.get_json("/api/site")
    assert {key: site[key] for key in ("name", "fps", "width", "height", "gop", "lookahead_s")} == {
        "name": "hall",
        "fps": FPS,
        "width": WIDTH,
        "height": HEIGHT,
        "gop": GOP,
        "lookahead_s": 2 * GOP / FPS,
    }
    assert re.fullmatch(r"avc1\.[0-9A-F]{6}", site["codec"])
    assert site["cameras"] == list(CAMERAS)
    assert site["pulse0"] is None
    assert abs(site["now"]) > 1e9


async def test_before_the_first_picture_there_is_no_codec_and_no_stream_yet(served: ServedSite) -> None:
    assert (await served.get_json("/api/site"))["codec"] is None
    code, content = await served.get("/cameras/c0/live.mp4")
    assert code == 503
    assert content == {"error": "no camera has delivered a picture yet"}
    async with served.session.get("/readyz") as answer:
        assert answer.status == 503
    async with served.session.get("/healthz") as answer:
        assert (answer.status, await answer.text()) == (200, "ok\n")


async def test_health_checks_are_answered_under_a_flood_of_camera_messages(served: ServedSite) -> None:
    """Messages arrive faster than they can be processed, for longer than a health check waits."""
    flood: Inbox[int] = Inbox(lambda left: flood.put(left - 1) if left else None, turn_s=0.0)
    flood.put(100_000)
    for _ in range(3):
        async with served.session.get("/healthz") as answer:
            assert answer.status == 200
    assert flood.waiting


async def test_all_people_are_listed_with_the_cameras_that_show_and_see_them(
    site_with_people: ServedSite,
) -> None:
    one, two = (await site_with_people.get_json("/api/objects"))["objects"]
    assert one == {
        "object": 1,
        "name": None,
        "aliases": [],
        "first_seen": 0,
        "last_seen": 14,
        "visible": True,
        "camera": B,
        "cameras": [A, B],
        "thumbnail": None,
    }
    assert (two["object"], two["camera"], two["cameras"]) == (2, A, [A])


async def test_the_cameras_are_listed_with_their_state(site_with_people: ServedSite) -> None:
    site_with_people.service.ingest.receive_status(status(A, fps=24.5, missed=3, shed=2, load_level=2))
    c0, c1 = (await site_with_people.get_json("/api/cameras"))["cameras"]
    assert c0 == {
        "camera": A,
        "state": "live",
        "pulse": 14,
        "late": 0,
        "fps": 24.5,
        "missed": 3,
        "shed": 2,
        "load_level": 2,
        "synchronized": True,
        "message": "",
        "retry_at": None,
        "condition": "clear",
        "condition_since": None,
        "covered_share": 0.0,
    }
    assert c1["state"] == "live"
    async with site_with_people.session.get("/readyz") as answer:
        assert (answer.status, await answer.text()) == (200, "2 of 2 cameras\n")


async def test_the_condition_of_a_cameras_picture_is_listed_and_measured(
    site_with_people: ServedSite,
) -> None:
    site_with_people.service.ingest.receive_status(status(A, condition="frozen", condition_since=12.5))
    c0, c1 = (await site_with_people.get_json("/api/cameras"))["cameras"]
    assert (c0["condition"], c0["condition_since"], c1["condition"]) == ("frozen", 12.5, "clear")
    assert c0["message"].startswith("the picture is frozen: ")
    async with site_with_people.session.get("/metrics") as answer:
        lines = (await answer.text()).splitlines()
    assert f'myview_camera_condition{{camera="{A}",condition="frozen"}} 1.0' in lines
    assert f'myview_camera_condition{{camera="{A}",condition="clear"}} 0.0' in lines


async def test_the_covered_share_of_a_cameras_picture_is_listed_and_measured(
    site_with_people: ServedSite,
) -> None:
    site_with_people.service.ingest.receive_status(status(A, covered_share=0.35))
    c0, c1 = (await site_with_people.get_json("/api/cameras"))["cameras"]
    assert (c0["covered_share"], c0["condition"], c1["covered_share"]) == (0.35, "clear", 0.0)
    assert c0["message"].startswith("35 % of the picture is covered: ")
    async with site_with_people.session.get("/metrics") as answer:
        lines = (await answer.text()).splitlines()
    assert f'myview_camera_covered_share{{camera="{A}"}} 0.35' in lines


async def test_a_refused_camera_is_listed_with_the_reason(site_with_people: ServedSite) -> None:
    site_with_people.service.ingest.receive_video(video(A, encoded(5, crf=40)[0]))
    c0 = (await site_with_people.get_json("/api/cameras"))["cameras"][0]
    assert c0["state"] == "refused"
    assert "parameter sets differ" in c0["message"]


async def test_past_choices_are_explained_from_the_first_request_on(site_with_people: ServedSite) -> None:
    newest = await site_with_people.get_json("/api/objects/1/choice")
    site_with_people.service.feed(3, {A: {1: SMALL}, B: {1: LARGE}})
    assert (await site_with_people.get_json("/api/objects/1/choice"))["first"] == newest["first"] + GOP
    for at in (f"p{newest['first']}", f"p{newest['first'] + GOP - 1}", f"-{GOP / FPS}"):
        assert await site_with_people.get_json(f"/api/objects/1/choice?at={at}") == newest
    for path, expected, error in (
        ("1/choice?at=p0", 404, "no reasons are stored"),
        ("1/choice?at=p999999", 404, "no reasons are stored"),
        ("9/choice?at=-1", 404, "object 9"),
        ("1/choice?at=soon", 400, "at: 'soon' is not a time"),
    ):
        code, content = await site_with_people.get(f"/api/objects/{path}")
        assert code == expected
        assert error in content["error"]


async def test_a_choice_is_explained(site_with_people: ServedSite) -> None:
    choice = await site_with_people.get_json("/api/objects/1/choice")
    costs, quality, terms, weights = (choice.pop(field) for field in ("costs", "quality", "terms", "weights"))
    assert 0 == costs[B] < costs[A] < 1
    assert costs[A] == pytest.approx(1 - quality[A] / quality[B])
    for camera, worth in quality.items():
        assert worth == pytest.approx(
            math.prod(1 - weights[weight] * (1 - terms[camera][weight]) for weight in weights)
        )
    assert choice.pop("stay_s") == 0.0
    assert choice.pop("cut_s") == pytest.approx((2 * GOP / FPS + 0.5) * costs[A] + 1.0 / FPS)
    assert choice == {
        "object": 1,
        "first": GOP,
        "frames": GOP,
        "camera": B,
        "since": 0,
        "seen": {A: 1.0, B: 1.0},
        "undetected": {A: 0.0, B: 0.0},
        "undetected_quality": {A: None, B: None},
        "before": B,
        "lookahead_s": 2 * GOP / FPS,
        "cut_to": A,
        "switch_cost_s": 1.0 / FPS,
        "reason": "c1 sees this person best over the next frames.",
    }


async def test_a_thumbnail_is_of_the_chosen_camera_and_its_url_changes_with_it(
    site_with_people: ServedSite,
) -> None:
    site_with_people.service.ingest.receive_thumbnail(thumbnail(A, 1, b"\xff\xd8 of c0", pulse=14))
    site_with_people.service.ingest.receive_thumbnail(thumbnail(B, 1, b"\xff\xd8 of c1", pulse=10))
    one = (await site_with_people.get_json("/api/objects"))["objects"][0]
    assert one["thumbnail"].endswith("objects/1/thumb.jpg?v=10")
    async with site_with_people.session.get("/objects/1/thumb.jpg?v=10") as answer:
        assert answer.content_type == "image/jpeg"
        assert await answer.read() == b"\xff\xd8 of c1"
