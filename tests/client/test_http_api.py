"""Single requests of the client: site, objects, cameras, choices; and their errors."""

from __future__ import annotations

import socket

import pytest
from aiohttp import web
from aiohttp.test_utils import TestServer

import client
from client.http import server_url

HASTY = client.HttpSettings(stream_retries=1, backoff_first=0.01, backoff_most=0.01)


async def test_the_site_is_fetched(site_url: str) -> None:
    site = await client.site(site_url)
    assert (site.name, site.fps, site.gop, site.cameras) == ("hall", 25.0, 5, ("c0", "c1"))
    assert site.pulse0 is None


async def test_objects_are_listed_and_unknown_fields_ignored(site_url: str) -> None:
    (one,) = await client.objects(site_url)
    assert (one.object, one.visible, one.camera, one.cameras) == (1, True, "c0", ("c0", "c1"))


async def test_the_cameras_are_listed(site_url: str) -> None:
    (camera,) = await client.cameras(site_url)
    assert (camera.camera, camera.state, camera.late) == ("c0", "live", 0)


async def test_a_choice_has_the_costs_of_every_camera(site_url: str) -> None:
    choice = await client.choice(site_url, 1)
    assert choice.costs == {"c0": 0.31, "c1": None}
    assert choice.reason == "c0 shows it largest"


async def test_an_unknown_object_is_reported_with_the_servers_text(site_url: str) -> None:
    with pytest.raises(client.NotFoundError, match=r"^there is no such object$"):
        await client.choice(site_url, 7)


async def test_an_unreachable_server_is_an_away_error() -> None:
    with socket.socket() as held:  # bound and not listening
        held.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{held.getsockname()[1]}"
        with pytest.raises(client.AwayError, match=f"^{url}: Connection refused$"):
            await client.objects(url)


async def test_an_unknown_host_name_is_reported() -> None:
    with pytest.raises(client.AwayError) as caught:
        await client.objects("http://nobody.invalid")
    assert "ssl" not in str(caught.value)
    assert "nobody.invalid: " in str(caught.value)


@pytest.mark.parametrize(
    ("status", "body", "error"),
    [
        (200, "<html>router</html>", client.ContractError),
        (200, '{"objects": 3}', client.ContractError),
        (401, "who are you?", client.RefusedError),
        (503, '{"error": "starting"}', client.AwayError),
        (503, '{"error": ""}', client.AwayError),
    ],
)
async def test_other_answers_are_reported_in_one_line(status: int, body: str, error: type[Exception]) -> None:
    async def answer(_: web.Request) -> web.Response:
        return web.Response(status=status, text=body)

    app = web.Application()
    app.router.add_get("/api/objects", answer)
    async with TestServer(app) as server:
        with pytest.raises(error) as caught:
            await client.objects(str(server.make_url("/")))
    assert "\n" not in str(caught.value)
    assert str(caught.value)


@pytest.mark.parametrize(
    ("entered", "normalized"),
    [
        ("http://host:8080", "http://host:8080"),
        ("host:8080", "http://host:8080"),
        ("http://host:8080/?object=3", "http://host:8080/"),
        ("https://host/myview/", "https://host/myview/"),
    ],
)
def test_a_link_to_the_page_is_a_valid_address(entered: str, normalized: str) -> None:
    assert str(server_url(entered)) == normalized
    assert str(server_url(entered) / "api/objects").startswith(normalized.rstrip("/") + "/api/")


@pytest.mark.parametrize("entered", ["", "ftp://host/", "http://", "http://host:port/"])
def test_an_invalid_address_is_refused(entered: str) -> None:
    with pytest.raises(ValueError, match="not an address"):
        server_url(entered)
