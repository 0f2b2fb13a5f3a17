"""Responses of all routes: one-line errors, HEAD, the page, the API description, metrics."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from types import SimpleNamespace

import pytest

from fakes.service.fed_site import A, B, ServedSite
from fakes.service.scripted_cameras import camera_tracks, status, tracks
from server.http.api import openapi
from server.http.app import make_app
from server.service.service import BestViewService
from server.service.streaming.subscriber_queue import Subscriber


@pytest.mark.parametrize(
    ("path", "error"),
    [
        ("/api/objects/99/choice", "there is no object 99"),
        ("/objects/99/best.mp4", "there is no object 99"),
        ("/objects/99/best.mp4?overlay=1", "there is no object 99"),
        ("/objects/99/best.mjpeg", "there is no object 99"),
        ("/objects/99/best.jpg", "there is no object 99"),
        ("/cameras/c9/live.mjpeg", "there is no camera 'c9'; there are c0, c1"),
        ("/cameras/c9/live.jpg?overlay=1", "there is no camera 'c9'; there are c0, c1"),
        ("/objects/99/thumb.jpg", "there is no thumbnail of object 99"),
        ("/cameras/c9/live.mp4", "there is no camera 'c9'; there are c0, c1"),
        ("/api/nothing", "there is nothing at /api/nothing"),
        ("/objects/one/best.mp4", "there is nothing at /objects/one/best.mp4"),
        ("/objects/99999999999/best.mp4", "there is nothing at /objects/99999999999/best.mp4"),
        ("/page/none.js", "there is nothing at /page/none.js"),
    ],
)
async def test_unknown_addresses_get_404_with_one_line_of_json(
    site_with_people: ServedSite, path: str, error: str
) -> None:
    assert await site_with_people.get(path) == (404, {"error": error})


@pytest.mark.parametrize(
    ("path", "error"),
    [
        ("/objects/1/best.mp4?overlay=yes", "overlay=yes: must be 0 or 1"),
        ("/objects/1/best.jpg?overlay=", "overlay=: must be 0 or 1"),
        ("/objects/1/best.ts?overlay=1", "overlay: boxes are burnt into a person's best.mp4"),
        ("/cameras/c0/live.mp4?overlay=1", "overlay: boxes are burnt into a person's best.mp4"),
        ("/objects/1/best.jpg?from=-5", "from: only .mp4, .ts and HLS can begin in the past"),
        ("/objects/1/hls/0.m4s?from=-5", "from: only .mp4, .ts and HLS can begin in the past"),
        ("/cameras/c0/live.mjpeg?to=-5", "to: only .mp4, .ts and HLS can begin in the past"),
    ],
)
async def test_unsupported_query_parameters_of_streams_are_refused(
    site_with_people: ServedSite, path: str, error: str
) -> None:
    code, content = await site_with_people.get(path)
    assert code == 400
    assert content["error"].startswith(error)
    assert "\n" not in content["error"]


async def test_overlay_and_time_shift_are_described_where_supported(site_with_people: ServedSite) -> None:
    described = await site_with_people.get_json("/api/openapi.json")
    for path, item in described["paths"].items():
        if "get" not in item:
            continue  # WHEP
        queries = {parameter["name"] for parameter in item["get"]["parameters"] if parameter["in"] == "query"}
        if path.startswith(("/objects/", "/cameras/")):
            url = (
                path.replace("{object}", "1")
                .replace("{camera}", A)
                .replace("{segment}", "0")
                .replace("{part}", "0")
            )
            for query in ("overlay=1", "from=p0", "camera=c0"):
                async with site_with_people.session.head(f"{url}?{query}") as answer:
                    assert (answer.status == 400) == (query.split("=")[0] not in queries), url


@pytest.mark.parametrize(
    "path",
    [
        "/page/../app.py",
        "/page/%2e%2e/__init__.py",
        "/page/..%2f__init__.py",
        "/page/%2e%2e%2f%2e%2e%2fpyproject.toml",
        "/page//etc/passwd",
        "/page/%2fetc%2fpasswd",
        "/page/%00",
        f"/page/{'a' * 5000}",
        "/page/.",
    ],
)
async def test_no_file_outside_the_page_is_served(served: ServedSite, path: str) -> None:
    # A raw request: a client library would normalize the path.
    reader, writer = await asyncio.open_connection("127.0.0.1", served.port)
    writer.write(f"GET {path} HTTP/1.0\r\n\r\n".encode())
    answer = await reader.read()
    assert answer.startswith(b"HTTP/1.0 404")
    assert b'{"error":' in answer
    writer.close()
    await writer.wait_closed()


async def test_an_unsupported_method_gets_405_with_the_allowed_ones(served: ServedSite) -> None:
    async with served.session.post("/api/objects") as answer:
        assert answer.status == 405
        assert answer.headers["Allow"] == "GET,HEAD"
        assert await answer.json() == {"error": "POST is not possible here"}


async def test_a_server_error_gets_500_without_a_traceback(
    served: ServedSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(served.service, "frame_buffers", {})
    assert await served.get("/api/cameras") == (
        500,
        {"error": "internal server error; see the server's log"},
    )


@pytest.mark.parametrize("version", ["1.0", "1.1"])
async def test_a_server_error_during_an_answer_resets_the_connection(
    site_with_people: ServedSite, monkeypatch: pytest.MonkeyPatch, version: str
) -> None:
    """After an orderly close a client would take a part of a stream for all of it."""

    async def some(_: Subscriber) -> AsyncIterator[SimpleNamespace]:
        yield SimpleNamespace(data=b"some of it")
        raise PermissionError(13, "the disk is gone")

    monkeypatch.setattr(Subscriber, "chunks", some)
    reader, writer = await asyncio.open_connection("127.0.0.1", site_with_people.port)
    writer.write(f"GET /objects/1/best.mp4 HTTP/{version}\r\nHost: 127.0.0.1\r\n\r\n".encode())
    head = await reader.readuntil(b"\r\n\r\n")
    assert b" 200 OK" in head
    with pytest.raises(ConnectionResetError):
        await reader.read()
    writer.close()


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        ("/api/site", "application/json"),
        ("/objects/1/best.mp4", "video/mp4"),
        ("/cameras/c0/live.mp4", "video/mp4"),
        ("/objects/1/best.mp4?overlay=1", "video/mp4"),
        ("/objects/1/best.mjpeg", "multipart/x-mixed-replace"),
        ("/cameras/c0/live.mjpeg?overlay=1", "multipart/x-mixed-replace"),
        ("/objects/1/best.jpg", "image/jpeg"),
        ("/cameras/c0/live.jpg", "image/jpeg"),
        ("/api/events", "text/event-stream"),
        ("/", "text/html"),
    ],
)
async def test_head_returns_only_headers(site_with_people: ServedSite, path: str, kind: str) -> None:
    for _ in range(2):  # on one connection, which must stay of use
        async with site_with_people.session.head(path) as answer:
            assert answer.status == 200
            assert answer.content_type == kind
            assert await answer.read() == b""
    assert site_with_people.service.splicer.viewers == 0


async def test_the_description_has_every_route_except_the_page(site_with_people: ServedSite) -> None:
    app = make_app(BestViewService(site_with_people.service))
    routes = {route.resource.canonical for route in app.router.routes() if route.resource is not None}
    described = await site_with_people.get_json("/api/openapi.json")
    assert set(described["paths"]) == routes - {"/", "/operator", "/page/{file}", "/api", "/api/openapi.json"}
    for path, item in described["paths"].items():
        operation = next(iter(item.values()))
        assert operation["summary"], path
        inside = {parameter["name"] for parameter in operation["parameters"] if parameter["in"] == "path"}
        assert inside == set(re.findall(r"\{(\w+)\}", path))
    requests = {
        parameter["name"]: parameter["required"]
        for parameter in described["paths"]["/api/past"]["get"]["parameters"]
    }
    assert requests == {"from": True, "to": False}


async def test_the_description_is_built_once(
    site_with_people: ServedSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = await site_with_people.get_json("/api/openapi.json")
    monkeypatch.setattr(openapi, "describe", None)
    assert await site_with_people.get_json("/api/openapi.json") == first
    async with site_with_people.session.get("/api") as answer:
        assert answer.status == 200


async def test_every_answer_matches_its_schema(site_with_people: ServedSite) -> None:
    described = await site_with_people.get_json("/api/openapi.json")
    schemas = described["components"]["schemas"]
    for path, item in described["paths"].items():
        responses = item.get("get", {"responses": {}})["responses"]
        content = responses.get("200", {"content": {}})["content"]
        if "application/json" not in content or "409" in responses:
            continue  # 409: without a configuration file there is no other answer
        answer = await site_with_people.get_json(path.replace("{object}", "1").replace("{camera}", A))
        schema = schemas[content["application/json"]["schema"]["$ref"].rsplit("/", 1)[1]]
        assert set(schema["required"]) == set(answer) == set(schema["properties"])


async def test_the_description_has_a_readable_page(served: ServedSite) -> None:
    async with served.session.get("/api") as answer:
        text = await answer.text()
    assert answer.content_type == "text/html"
    assert "/objects/{object}/best.mp4" in text


async def test_the_page_and_its_files_are_served(served: ServedSite) -> None:
    async with served.session.get("/?object=1") as answer:
        page = await answer.text()
        assert "default-src 'self'" in answer.headers["Content-Security-Policy"]
    for file in re.findall(r'(?:src|href)="(/?page/[^"]+)"', page):
        async with served.session.get("/" + file.lstrip("/")) as answer:
            assert answer.status == 200
            assert answer.headers["X-Content-Type-Options"] == "nosniff"


async def test_metrics_are_served(site_with_people: ServedSite) -> None:
    site_with_people.service.ingest.receive_status(status(A, missed=3, shed=2, clock_offset=0.25))
    site_with_people.service.ingest.receive_tracks(tracks(camera_tracks(A, 3, {}, without_peers=[15, 17])))
    site_with_people.service.ingest.receive_tracks(tracks(camera_tracks(B, 3, {})))
    site_with_people.service.joint.offsets = {A: 0.12}
    site_with_people.service.decide()
    async with site_with_people.session.get("/metrics") as answer:
        lines = (await answer.text()).splitlines()
    assert "myview_pulse 14.0" in lines
    assert "myview_objects 2.0" in lines
    assert 'myview_camera_frames_total{camera="c0"} 15.0' in lines
    assert 'myview_camera_missed_total{camera="c0"} 3.0' in lines
    assert 'myview_camera_live{camera="c1"} 1.0' in lines
    assert 'myview_camera_without_peers_total{camera="c0"} 2.0' in lines
    assert 'myview_camera_without_peers_total{camera="c1"} 0.0' in lines
    assert 'myview_camera_clock_offset_seconds{camera="c0"} 0.25' in lines
    assert 'myview_camera_floor_offset_meters{camera="c0"} 0.12' in lines
