"""The API matches its OpenAPI description, checked by schemathesis."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pytest
import requests
import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode
from schemathesis.checks import content_type_conformance, response_schema_conformance, status_code_conformance

from benchmarks.fuzz.http.served_site import ServedSite
from fakes.setup.onvif_camera import FakeProfile, OnvifCamera, onvif_cameras
from fakes.timeouts import PATIENCE
from server.http.access.csrf import CSRF_HEADER

CASES = 4
"""Per operation and mode; of endless streams only the beginning is read."""
CHECKS = [content_type_conformance, response_schema_conformance, status_code_conformance]
"""A 500 is never documented; a 400 may be, since a schema cannot describe times."""
ENDLESS = ("video/", "multipart/", "text/event-stream")
DECODED = (".mjpeg", ".jpg")
"""Paths that start a render worker, which other tests cover."""


@schemathesis.serializer("application/sdp")
def serialize_offer(_: Any, value: Any) -> bytes:
    """Return a body that is most likely no SDP offer."""
    return str(value).encode("utf-8", "surrogatepass")


@dataclass
class Site:
    """A served site and its documented operations."""

    url: str
    operations: dict[str, Any]


@pytest.fixture(scope="module")
def documented_site() -> Iterator[Site]:
    """Serve a site in a thread, since schemathesis blocks."""
    served = ServedSite(loop=asyncio.new_event_loop())
    loop = served.loop
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    try:
        url = f"http://127.0.0.1:{served.port}"
        schema = schemathesis.openapi.from_url(f"{url}/api/openapi.json")
        found = [operation.ok() for operation in schema.get_all_operations()]
        yield Site(url, {operation.label: operation for operation in found})
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        served.close()


def endless(operation: Any) -> bool:
    """Return whether an answer has no end."""
    found = operation.definition.raw["responses"].get("200", {})
    return any(kind.startswith(ENDLESS) for kind in found.get("content", {}))


@pytest.mark.parametrize("mode", list(GenerationMode))
def test_every_answer_is_documented(
    documented_site: Site, mode: GenerationMode, caplog: pytest.LogCaptureFixture
) -> None:
    for label, operation in documented_site.operations.items():
        if label.endswith(DECODED):
            continue

        @settings(
            max_examples=CASES,
            derandomize=True,
            database=None,
            deadline=None,
            suppress_health_check=list(HealthCheck),
        )
        @given(case=operation.as_strategy(generation_mode=mode) if _has(operation, mode) else st.none())
        def ask(case: Any) -> None:
            if case is not None:
                _ask(documented_site, case)

        with contextlib.suppress(Unsatisfiable):  # no invalid request exists
            ask()
    assert not [record for record in caplog.records if record.exc_info and record.levelno >= logging.WARNING]


def test_the_answer_while_a_camera_keeps_silent_is_documented(documented_site: Site) -> None:
    operation = documented_site.operations["POST /api/operator/site_cameras"]
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"rtsp://127.0.0.1:{silent.getsockname()[1]}/"
        answer = operation.Case(headers={CSRF_HEADER: "1"}).call_and_validate(
            base_url=documented_site.url, timeout=PATIENCE, checks=CHECKS, json={"address": address}
        )
    assert (answer.status_code, answer.json().get("ahead")) == (202, 0), answer.text


def test_the_answer_while_a_found_camera_is_asked_for_its_streams_is_documented(
    documented_site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("onvif", reason="needs onvif-zeep-async: the extra onvif")

    def ask(label: str, **arguments: Any) -> tuple[int, Any]:
        case = documented_site.operations[label].Case(
            headers={CSRF_HEADER: "1"}, path_parameters=arguments.pop("path", {})
        )
        answer = case.call_and_validate(
            base_url=documented_site.url, timeout=PATIENCE, checks=CHECKS, **arguments
        )
        return answer.status_code, answer.json()

    answers = threading.Event()

    def when_it_answers(body: bytes) -> bytes:
        assert answers.wait(PATIENCE)
        return body

    stream = FakeProfile("main", "rtsp://127.0.0.1/live", 64, 48, 12)
    camera = OnvifCamera("door", [stream], damage=when_it_answers)
    with onvif_cameras(camera) as targets:
        monkeypatch.setenv("MYVIEW_DISCOVERY", targets)
        _, search = ask("POST /api/operator/setup/search")
        (found,) = search["cameras"]
        query = {"host": found["host"], "port": found["port"], "user": "viewer", "password": "s3cret"}
        status, trial = ask("POST /api/operator/setup/streams", json=query)
        answers.set()
        assert (status, trial.get("ahead")) == (202, 0), trial
        answer = 202, trial
        while answer[0] == 202:
            answer = ask("GET /api/operator/setup/trials/{key}", path={"key": trial["trial"]})
    status, offered = answer
    assert status == 200, offered
    assert [(each["name"], each["width"]) for each in offered["streams"]] == [("main", 64)]


def _has(operation: Any, mode: GenerationMode) -> bool:
    return mode is GenerationMode.POSITIVE or bool(operation.definition.raw["parameters"])


def _ask(site: Site, case: Any) -> None:
    if endless(case.operation):
        kwargs = case.as_transport_kwargs(base_url=site.url)
        with requests.request(**kwargs, stream=True, timeout=PATIENCE) as answer:
            documented = case.operation.definition.raw["responses"]
            assert str(answer.status_code) in documented, f"{case.as_curl_command()}: {answer.status_code}"
    else:
        answer = case.call_and_validate(base_url=site.url, timeout=PATIENCE, checks=CHECKS)
        if case.meta.generation.mode is GenerationMode.POSITIVE:
            assert answer.status_code != 403, f"the description lacks what permits it: {answer.text}"
