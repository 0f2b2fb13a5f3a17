"""Cameras are asked for their streams and tried over real RTSP; hostile ones harm nothing."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.media.rtsp_camera import RtspCamera
from fakes.service.scripted_cameras import encoded
from fakes.setup.onvif_camera import FakeProfile, OnvifCamera, onvif_cameras
from server.config.camera_password import fill_in_password
from server.config.loader import load_config
from server.setup.camera_address import parse_address, parse_addresses
from server.setup.discovery import FoundCamera
from server.setup.onvif_profiles import INSTALL, query_profiles, stream_address
from server.setup.session import SetupSession
from server.setup.stream_pair import propose_pair
from server.setup.trial_messages import ProfilesRequest, StreamProfile
from server.system.errors import UserError

LOGIN = ("viewer", "p@ss:/w ord")
FPS = 12.5
pytest.importorskip("onvif", reason="needs onvif-zeep-async: the extra onvif")


@contextmanager
def rtsp() -> Iterator[RtspCamera]:
    units = encoded(0, 40)
    camera = RtspCamera([units[at : at + 5] for at in range(0, 40, 5)], FPS, login=LOGIN, live=True)
    try:
        yield camera
    finally:
        camera.close()


async def test_a_found_camera_is_asked_tried_named_and_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = SetupSession(tmp_path / "site.yaml")
    with rtsp() as stream:
        reported = stream.url.replace("127.0.0.1", "10.99.99.99")  # as behind a router
        profiles = [FakeProfile("sub", reported, 32, 24, 12), FakeProfile("main", reported, 64, 48, 12)]
        camera = OnvifCamera("front door", profiles, LOGIN)
        with onvif_cameras(camera) as targets:
            monkeypatch.setenv("MYVIEW_DISCOVERY", targets)
            (found,) = await session.discover(1.0)
            refused, _ = await session.profiles(found.host, found.port, "viewer", "wrong")
            unnamed, _ = await session.profiles(found.host, found.port, "", "")
            answer, keys = await session.profiles(found.host, found.port, *LOGIN)
        assert refused.needs_password
        assert refused.error == "it refuses this user and password"
        assert (unnamed.error, unnamed.needs_password) == ("it wants a user and password", True)
        assert [(profile.name, profile.width) for profile in answer.profiles] == [("main", 64), ("sub", 32)]
        tried = await session.add(session.offered(keys[0]), found.name)
        with pytest.raises(UserError, match="in the list already"):
            await session.add(session.offered(keys[1]))
        with pytest.raises(UserError, match="401") as unauthorized:
            await session.add(parse_addresses(f"{stream.url}/sub", "viewer", "wr0ng"))
    assert "wr0ng" not in str(unauthorized.value)
    assert (tried.name, tried.sends) == ("front-door", "h264 64x48, 12.5 fps")
    assert tried.trial.picture.startswith(b"\xff\xd8")
    session.rename(tried.key, "door")
    session.write("hall", session.proposal)
    assert "rtsp://viewer:{password}@127.0.0.1" in session.path.read_text()


async def test_what_one_operator_found_stays_when_another_searches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = SetupSession(tmp_path / "site.yaml")
    door, yard = (
        OnvifCamera(name, [FakeProfile("main", "rtsp://127.0.0.1/live", 64, 48, 12)], LOGIN)
        for name in ("door", "yard")
    )
    with onvif_cameras(door) as first, onvif_cameras(yard) as second:
        found = list[FoundCamera]()
        for targets in (first, second):
            monkeypatch.setenv("MYVIEW_DISCOVERY", targets)
            found += await session.discover(1.0)
        assert [camera.name for camera in found] == ["door", "yard"]
        for camera in found:
            answer, _ = await session.profiles(camera.host, camera.port, *LOGIN)
            assert [each.name for each in answer.profiles] == ["main"]
        monkeypatch.setattr("server.setup.session._MAX_FOUND", 1)
        await session.discover(1.0)
        with pytest.raises(UserError, match="search again"):
            await session.profiles(found[0].host, found[0].port, *LOGIN)


def profile(name: str, width: int, height: int, codec: str = "H264") -> StreamProfile:
    return StreamProfile(name, f"rtsp://10.0.0.1/{name}", codec, width, height, 25.0)


@pytest.mark.parametrize(
    ("profiles", "source", "substream"),
    [
        ([profile("main", 1920, 1080), profile("sub", 640, 360)], "main", "sub"),
        ([profile("sub", 640, 360), profile("main", 1920, 1080)], "main", "sub"),
        (
            [profile("4k", 3840, 2160, "H265"), profile("hd", 1920, 1080), profile("cif", 352, 288)],
            "hd",
            "cif",
        ),
        ([profile("4k", 3840, 2160, "H265"), profile("sub", 640, 480, "H265")], "4k", "sub"),
        (
            [profile("main", 1920, 1080), profile("third", 704, 576), profile("tiny", 176, 144)],
            "main",
            "third",
        ),
        ([profile("main", 1920, 1080), profile("low", 320, 180)], "main", None),
        ([profile("main", 1920, 1080), profile("again", 1920, 1080)], "main", None),
        ([profile("only", 640, 480)], "only", None),
        ([profile("unknown", 0, 0)], "unknown", None),
    ],
)
def test_the_largest_h264_and_the_smallest_useful_stream_are_proposed(
    profiles: list[StreamProfile], source: str, substream: str | None
) -> None:
    pair = propose_pair(profiles)
    assert profiles[pair.source].name == source
    assert (None if pair.substream is None else profiles[pair.substream].name) == substream


async def test_a_camera_is_written_with_its_substream(tmp_path: Path) -> None:
    session = SetupSession(tmp_path / "site.yaml")
    with rtsp() as main, rtsp() as small:
        with pytest.raises(UserError, match="the substream is the stream that viewers get"):
            await session.add(parse_addresses(main.url, *LOGIN, main.url))
        one, other = (url.replace("//", f"//viewer:{n}@") for n, url in enumerate((main.url, small.url)))
        with pytest.raises(UserError, match="the substream's password must be that of the camera"):
            await session.add(parse_addresses(one, substream=other))
        with pytest.raises(UserError, match=r"the substream: rtsp://.*: cannot open this video"):
            await session.add(parse_addresses(main.url, *LOGIN, "rtsp://127.0.0.1:9/live"))
        tried = await session.add(parse_addresses(main.url, *LOGIN, small.url), "door")
        assert (tried.sends, tried.tracked_in) == ("h264 64x48, 12.5 fps", "h264 64x48, 12.5 fps")
        session.write("hall", session.proposal)
        assert LOGIN[1] not in session.path.read_text()
        camera = fill_in_password(load_config(session.path), "door").camera("door")
        address = parse_address(small.url, *LOGIN).with_password
        assert camera.substream == address
        assert camera.source != address
    assert "  # people are tracked in it, h264 64x48" in session.path.read_text()


@pytest.mark.parametrize(
    "answer",
    [
        b"",
        b"<html>no</html>",
        b"\xff" * 4096,
        b'<!DOCTYPE x [<!ENTITY a "' + b"a" * 9999 + b'"><!ENTITY b "' + b"&a;" * 9999 + b'">]><x>&b;</x>',
        b"<x>" * 100_000,
        b"x" * 50_000_000,
    ],
    ids=["empty", "html", "bytes", "entities", "depth", "length"],
)
def test_a_camera_that_answers_nonsense_is_one_line(answer: bytes) -> None:
    camera = OnvifCamera("door", [], answer=answer)
    with onvif_cameras(camera):
        found = query_profiles(ProfilesRequest("127.0.0.1", camera.port, *LOGIN))
    assert found.error
    assert len(found.error.splitlines()) == 1
    assert not found.profiles


@settings(max_examples=40)
@given(st.floats(0, 1), st.binary(max_size=8), st.integers(0, 60), st.integers(0, 4))
def test_a_damaged_answer_is_read_or_refused_in_one_line(
    place: float, put: bytes, removed: int, spared: int
) -> None:
    answers = 0

    def damage(body: bytes) -> bytes:
        nonlocal answers
        answers += 1
        at = int(place * len(body))
        return body if answers <= spared else body[:at] + put + body[at + removed :]

    camera = OnvifCamera(
        "door", [FakeProfile("main", "rtsp://127.0.0.1/live", 64, 48, 12)], LOGIN, damage=damage
    )
    with onvif_cameras(camera):
        found = query_profiles(ProfilesRequest("127.0.0.1", camera.port, *LOGIN))
    assert len(found.error.splitlines()) <= 1
    assert LOGIN[1] not in found.error
    for profile in found.profiles:
        assert profile.address.startswith("rtsp://127.0.0.1")
        assert profile.name.isprintable()
        assert 0 <= profile.width <= 16_384


@pytest.mark.parametrize("sent", [b"", b"RTSP/1.0 200 OK\r\n\r\n", b"HTTP/1.1 200 OK\r\n\r\n" + b"\0" * 5000])
async def test_a_source_that_sends_nonsense_is_one_line(tmp_path: Path, sent: bytes) -> None:
    session = SetupSession(tmp_path / "site.yaml")
    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=_answer, args=(server, sent), daemon=True).start()
        port = server.getsockname()[1]
        with pytest.raises(UserError, match=f"127.0.0.1:{port}/\\.\\.\\.: ") as refused:
            await session.add(parse_addresses(f"rtsp://127.0.0.1:{port}/live", "viewer", "s3cret"))
    assert "s3cret" not in str(refused.value)
    assert session.cameras == []


def _answer(server: socket.socket, sent: bytes) -> None:
    while True:
        try:
            client, _ = server.accept()
        except OSError:
            return
        with client:
            client.recv(4096)
            client.sendall(sent)


async def test_only_found_cameras_get_a_password_and_only_few_are_tried_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.setup.session._MAX_WAITING", 2)
    session = SetupSession(tmp_path / "site.yaml")
    with pytest.raises(UserError, match="search again"):
        await session.profiles("10.0.0.1", 80, *LOGIN)
    with pytest.raises(UserError, match="ask the camera again"):
        await session.add(session.offered(7))
    addresses = [session.add(parse_addresses(f"rtsp://127.0.0.1:{port}/")) for port in range(1, 6)]
    problems = await asyncio.gather(*addresses, return_exceptions=True)
    assert sum("too many" in str(problem) for problem in problems) == 3


async def test_a_camera_that_is_tried_twice_at_a_time_is_added_once(tmp_path: Path) -> None:
    session = SetupSession(tmp_path / "site.yaml")
    with rtsp() as stream:
        addresses = parse_addresses(stream.url, *LOGIN)
        results = await asyncio.gather(*(session.add(addresses) for _ in range(2)), return_exceptions=True)
    assert [str(result) for result in results if isinstance(result, UserError)] == [
        f"{stream.url.replace('live', '...')}: this camera is in the list already"
    ]
    assert len(session.cameras) == 1


@pytest.mark.parametrize(
    ("address", "local"),
    [
        ("rtsp://u:p@10.0.0.9:8554/a?b=1", "rtsp://10.0.0.1:8554/a?b=1"),
        ("rtsp://10.0.0.9/a", "rtsp://10.0.0.1/a"),
        ("http://10.0.0.9/a", None),
        ("file:///etc/passwd", None),
        ("rtsp://[/", None),
        ("rtsp://h:99999/", None),
        ("rtsp://h/\n", None),
    ],
)
def test_a_stream_is_taken_from_the_camera_that_was_asked(address: str, local: str | None) -> None:
    assert stream_address(address, "10.0.0.1") == local


def test_without_the_library_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.setup.onvif_profiles.is_installed", lambda: False)
    assert query_profiles(ProfilesRequest("127.0.0.1", 80)).error == INSTALL
