"""Tracks and choices of a time range, as files."""

from __future__ import annotations

import csv
import io

import pytest

from fakes.service.fed_site import A, B, ServedSite


async def rows(served: ServedSite, table: str, span: str) -> list[dict[str, str]]:
    async with served.session.get(f"/api/operator/{table}.csv?{span}") as answer:
        assert answer.status == 200
        assert answer.content_type == "text/csv"
        assert "attachment" in answer.headers["Content-Disposition"]
        assert "Access-Control-Allow-Origin" not in answer.headers
        return list(csv.DictReader(io.StringIO(await answer.text())))


async def test_every_box_and_choice_of_the_time_range_is_a_line(site_with_people: ServedSite) -> None:
    site_with_people.service.pulses.pulse0 = 1_000_000.0
    tracks = await rows(site_with_people, "tracks", "from=p2&to=p4")
    assert [(track["frame"], track["camera"], track["object"]) for track in tracks] == [
        (frame, camera, number) for frame in "34" for camera, number in ((A, "1"), (A, "2"), (B, "1"))
    ]
    assert [tracks[0][column] for column in ("left", "top", "width", "height")] == [
        "10.00",
        "10.00",
        "6.00",
        "18.00",
    ]
    assert tracks[0]["time"] == "1970-01-12T13:46:40.080Z"
    choices = await rows(site_with_people, "choices", "from=p4&to=p6")
    assert [(choice["frame"], choice["object"], choice["camera"]) for choice in choices] == [
        ("5", "1", B),
        ("5", "2", A),
        ("6", "1", B),
        ("6", "2", A),
    ]


async def test_without_an_end_the_download_has_all_decisions(site_with_people: ServedSite) -> None:
    frames = {int(row["frame"]) for row in await rows(site_with_people, "tracks", "from=p0")}
    assert frames == set(range(1, site_with_people.service.decision_state.end + 1))
    assert await rows(site_with_people, "tracks", "from=p900") == []


@pytest.mark.parametrize("span", ["", "from=soon", "from=p5&to=p5"])
async def test_an_invalid_time_range_is_refused(site_with_people: ServedSite, span: str) -> None:
    status, content = await site_with_people.get(f"/api/operator/choices.csv?{span}")
    assert status == 400
    assert "\n" not in content["error"]
