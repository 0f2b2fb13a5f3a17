"""Viewers who see people pixelated: what they are sent, rendered by real processes, and what is refused."""

from __future__ import annotations

import io
import json
from contextlib import aclosing
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np

from fakes.http.tokens import bearer, serve_with_tokens, token_entry, write_tokens
from fakes.service.blurred import assert_hides_others, shown_camera
from fakes.service.drawn_site import CAMERAS, GOP, Image, drawn_room, read_film
from fakes.service.fed_site import A, ServedSite, serve_site, show_people

ELSEWHERE = {"Via": "1.1 proxy"}
"""Marks a request as one from another machine."""


def picture_of(jpeg: bytes) -> Image:
    return np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR), np.uint8)


async def test_everybody_but_the_chosen_person_is_hidden_in_every_kind_of_picture(tmp_path: Path) -> None:
    names = ("guest", "yard")
    path = write_tokens(tmp_path / "tokens.yaml", *map(token_entry, names))
    async with aclosing(drawn_room(access={"tokens": str(path)})) as rooms:
        room = await anext(rooms)
        async with room.session.get("/objects/1/best.mp4", headers=bearer("guest")) as film:
            assert film.status == 200, await film.text()
            room.advance(3)
            data = await read_film(film, 2 * GOP)
        with av.open(io.BytesIO(data), "r") as stream:
            assert not stream.streams.audio
            for frame in list(stream.decode(video=0))[:: GOP - 1]:
                assert frame.time is not None
                pulse = round(frame.time * room.service.config.site.fps)
                shown = frame.to_ndarray(format="bgr24")
                assert_hides_others(room, shown, shown_camera(room, pulse, 1), pulse, 1)
        for address, name in (
            ("/objects/1/best.jpg", "guest"),
            (f"/cameras/{CAMERAS[0]}/live.jpg", "yard"),
        ):
            async with room.session.get(address, headers=bearer(name)) as answer:
                assert answer.status == 200, await answer.text()
                pulse, image = int(answer.headers["X-MyView-Pulse"]), picture_of(await answer.read())
            if "objects" in address:
                assert_hides_others(room, image, shown_camera(room, pulse, 1), pulse, 1)
            else:
                assert_hides_others(room, image, CAMERAS[0], pulse, None)


NOT_BLURRED = (
    "/objects/1/best.ts",
    "/objects/1/hls/index.m3u8",
    "/objects/1/thumb.jpg",
    "/objects/1/best.mp4?from=-5",
    "/objects/1/best.mp4?camera=c0",
    "/objects/1/best.mp4?prefer=c0",
    "/objects/1/best.mp4?delay=live",
    "/api/events?delay=live",
    "/api/objects/1/past",
    "/api/past?from=0",
    "/api/rules",
    "/cameras/c0/live.mp4",
    "/metrics",
)


async def test_what_cannot_be_blurred_is_refused_in_one_line(tmp_path: Path) -> None:
    async with serve_with_tokens(tmp_path, "guest") as served:
        show_people(served)
        for address in NOT_BLURRED:
            async with served.session.get(address, headers=bearer("guest")) as answer:
                error = (await answer.json())["error"]
            assert answer.status == 403
            assert "not with people blurred; there are best.mp4" in error
            assert "\n" not in error


async def test_names_thumbnails_and_sound_are_left_out_of_lists_and_events(tmp_path: Path) -> None:
    async with serve_with_tokens(tmp_path) as served:
        show_people(served)
        served.service.decider.people.registry.names[1] = "Ann"
        site = await get(served, "/api/site", "guest")
        sharp = await get(served, "/api/site", "desk")
        people = await get(served, "/api/objects", "guest")
        events = await first_events(served, "guest")
        delays = await get(served, "/api/delays", "guest")
    assert (site["blur"], site["sound"], sharp["blur"]) == ("others", None, None)
    assert [person["object"] for person in people["objects"]] == [1, 2]
    assert all(person["name"] is person["thumbnail"] is None for person in people["objects"])
    assert "Ann" not in json.dumps(events)
    assert events["gop"]["boxes"][A], "positions are sent"
    assert [delay["delay"] for delay in delays["delays"]] == ["balanced", "smooth"]


async def test_viewers_without_a_token_are_blurred_but_the_servers_own_machine_is_not() -> None:
    async with aclosing(serve_site(access={"blur": "everybody"})) as sites:
        served = await anext(sites)
        show_people(served)
        for headers, code in (({}, 200), (ELSEWHERE, 403)):
            async with served.session.get("/objects/1/best.ts", headers=headers) as answer:
                assert answer.status == code
        async with served.session.get("/api/site", headers=ELSEWHERE) as answer:
            assert (await answer.json())["blur"] == "everybody"
        async with served.session.get("/api/operator/people", headers=ELSEWHERE) as answer:
            assert "operating is possible from" in (await answer.json())["error"]


async def get(served: ServedSite, path: str, name: str) -> Any:
    async with served.session.get(path, headers=bearer(name)) as answer:
        assert answer.status == 200
        return await answer.json()


async def first_events(served: ServedSite, name: str) -> dict[str, Any]:
    """Return the events of a new subscriber up to the first decision, by kind."""
    found: dict[str, Any] = {}
    async with served.session.get("/api/events", headers=bearer(name)) as answer:
        kind = ""
        while "gop" not in found:
            line = (await answer.content.readline()).decode().strip()
            if line.startswith("event: "):
                kind = line.removeprefix("event: ")
            elif line.startswith("data: "):
                found[kind] = json.loads(line.removeprefix("data: "))
    return found
