"""A network camera: its newest image at every pulse, and a new connection after an absence."""

from __future__ import annotations

import errno
import http.server
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import cast

import av
import cv2
import numpy as np
import pytest
from av.audio.stream import AudioStream
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from expbackoff import Backoff
from fakes.media.videos import HEIGHT, STEP, WIDTH, frame_in, write_video
from fakes.timeouts import PATIENCE
from server.camera.audio import LiveAudioSource
from server.camera.sources import live_stream, open_source, stream_reader
from server.camera.sources.live_stream import LiveStream
from server.camera.sources.opening import OpenedVideo, open_video
from server.config.sections import CameraSettings, SiteSettings, SoundSettings
from server.system.errors import UnavailableError, UserError


class MotionJpeg:
    """A motion JPEG camera that shows a given picture until it is unplugged."""

    def __init__(self) -> None:
        self.frame, self.width = 0, WIDTH
        self.parts: int | None = None
        """After how many pictures it ends a connection."""
        self.left = 0
        """Connections that clients have ended."""
        self._unplugged = threading.Event()
        self._server: http.server.ThreadingHTTPServer | None = None
        self._thread: threading.Thread | None = None

    def plug_in(self, port: int = 0) -> int:
        camera, unplugged = self, threading.Event()

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
                self.end_headers()
                sent = 0
                while sent != camera.parts and not unplugged.wait(0.02):
                    sent += 1
                    grey = np.full((HEIGHT, camera.width, 3), STEP * camera.frame, np.uint8)
                    jpeg = cv2.imencode(".jpg", grey)[1].tobytes()
                    part = b"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(jpeg)
                    try:
                        self.wfile.write(part + jpeg + b"\r\n")
                    except OSError:
                        camera.left += 1
                        return

            def log_message(self, *_: object) -> None:
                pass

        http.server.ThreadingHTTPServer.allow_reuse_address = True
        self._unplugged = unplugged
        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))
        self._thread.start()
        return int(self._server.server_address[1])

    def unplug(self) -> None:
        self._unplugged.set()
        if self._server is not None and self._thread is not None:
            self._server.shutdown()
            self._thread.join()
            self._server.server_close()
        self._server = self._thread = None


@pytest.fixture
def camera() -> Iterator[MotionJpeg]:
    server = MotionJpeg()
    yield server
    server.unplug()


def until(condition: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "not within the timeout"
        time.sleep(0.01)


def shown(source: LiveStream) -> int | None:
    picture = source.take(0)
    return None if picture is None else frame_in(picture)


def test_the_newest_picture_is_shown(camera: MotionJpeg) -> None:
    source = LiveStream(f"http://127.0.0.1:{camera.plug_in()}/", {})
    try:
        assert source.size == (WIDTH, HEIGHT)
        until(lambda: shown(source) == 0)
        camera.frame = 7
        until(lambda: shown(source) == 7)
        assert shown(source) == 7, "the newest picture is returned again"
    finally:
        source.close()


def test_a_camera_is_shown_again_after_an_absence_and_no_old_picture_meanwhile(
    camera: MotionJpeg, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_stream, "_STALE_S", 0.2)
    monkeypatch.setattr(stream_reader, "_RETRY_FIRST_S", 0.05)
    port = camera.plug_in()
    source = LiveStream(f"http://127.0.0.1:{port}/", {})
    try:
        until(lambda: shown(source) == 0)
        camera.unplug()
        until(lambda: shown(source) is None)
        camera.frame = 9
        camera.plug_in(port)
        until(lambda: shown(source) == 9)
    finally:
        source.close()


def test_a_long_absence_is_logged_once_and_so_is_the_return(
    camera: MotionJpeg, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO", "server.camera.sources")
    monkeypatch.setattr(stream_reader, "_RETRY_FIRST_S", 0.01)
    monkeypatch.setattr(stream_reader, "_RETRY_MAX_S", 0.01)
    port = camera.plug_in()
    source = LiveStream(f"http://me:hunter2@127.0.0.1:{port}/?p=hunter2", {})
    try:
        until(lambda: shown(source) == 0)
        camera.unplug()
        until(lambda: source._away_log._count > 30)
        camera.plug_in(port)
        until(lambda: not source._away_log._count)
    finally:
        source.close()
    *away, back = caplog.records
    reasons = [record.getMessage() for record in away]
    assert {record.levelname for record in away} == {"WARNING"}
    assert "Connection refused" in reasons[-1]
    assert len(reasons) == len(set(reasons)) <= 3, "once for each reason, not for each attempt"
    assert back.getMessage().startswith(f"http://127.0.0.1:{port}/...: frames arrive again, after ")
    assert not [message for message in caplog.messages if "hunter2" in message]


def test_an_absent_camera_says_why_and_when_it_is_connected_again_without_secrets(
    camera: MotionJpeg, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stream_reader, "_RETRY_FIRST_S", 0.05)
    monkeypatch.setattr(stream_reader, "_RETRY_MAX_S", 60.0)
    port = camera.plug_in()
    source = LiveStream(f"http://me:hunter2@127.0.0.1:{port}/?p=hunter2", {})
    try:
        until(lambda: shown(source) == 0)
        assert source.absence is None
        camera.unplug()
        until(lambda: source.absence is not None and "refused" in source.absence.reason)
        until(lambda: source.absence is not None and source.absence.message().retry_s > 0.2)
        assert source.absence is not None
        message = source.absence.message()
        camera.plug_in(port)
        until(lambda: source.absence is None)
    finally:
        source.close()
    assert (message.cause, message.address) == ("lost", f"http://127.0.0.1:{port}/...")
    assert message.reason == "cannot open this video: Connection refused"


@pytest.mark.parametrize(("stable_s", "delays"), [(3.0, [0.5, 1.0, 2.0, 4.0]), (0.0, [0.5] * 4)])
def test_a_camera_that_ends_soon_again_and_again_is_connected_to_less_and_less_often(
    camera: MotionJpeg,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    stable_s: float,
    delays: list[float],
) -> None:
    """One that has worked for some time begins with the shortest delay again."""
    caplog.set_level("INFO", "server.camera.sources")
    waited: list[float] = []

    class Recorded(Backoff):
        def next(self) -> float:
            waited.append(super().next())
            return 0.01

    monkeypatch.setattr(stream_reader, "Backoff", Recorded)
    monkeypatch.setattr(stream_reader, "_STABLE_S", stable_s)
    camera.parts = 5
    source = LiveStream(f"http://127.0.0.1:{camera.plug_in()}/", {})
    try:
        until(lambda: len(waited) > len(delays))
    finally:
        source.close()
    assert waited[: len(delays)] == delays
    away, back = caplog.messages
    assert away.endswith("; retrying")
    assert "frames arrive again" in back


class PausingCamera:
    """A camera that sends MPEG-TS up to a frame, and the rest after ``resume`` is set."""

    def __init__(self, film: Path, pause_at: int) -> None:
        with av.open(str(film)) as container:
            places = [packet.pos or 0 for packet in container.demux(video=0) if packet.size]
        data, at = film.read_bytes(), places[pause_at]
        self._parts, self.resume = (data[:at], data[at:]), threading.Event()
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._server.getsockname()[1])
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        connection, _ = self._server.accept()
        with connection:
            connection.recv(65536)
            connection.sendall(b"HTTP/1.0 200 OK\r\n\r\n" + self._parts[0])
            assert self.resume.wait(PATIENCE)
            connection.sendall(self._parts[1])

    def close(self) -> None:
        self._thread.join()
        self._server.close()


class FrameListener:
    """Records which frames became the newest, as the audio source does."""

    def __init__(self) -> None:
        self.shown: list[int] = []

    def opened(self, stream: object) -> None:
        assert stream is None

    def picture(self, time: float) -> None:
        self.shown.append(round(float(time) * 25))


def test_after_a_silence_no_earlier_picture_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_stream, "_STALE_S", 0.2)
    camera = PausingCamera(write_video(tmp_path / "film.ts", 25), pause_at=20)
    frames = FrameListener()
    quick = {"analyzeduration": "100000", "probesize": "5000"}
    source = LiveStream(f"http://127.0.0.1:{camera.port}/", quick, frames)
    try:
        until(lambda: len(frames.shown) == 18)  # the decoder still holds the others
        until(lambda: source.take(0) is None)
        camera.resume.set()
        until(lambda: len(frames.shown) > 20)
        assert frames.shown[:20] == [*range(18), 20, 21]
    finally:
        camera.resume.set()
        camera.close()
        source.close()


@pytest.mark.timeout(PATIENCE)
@pytest.mark.parametrize("connected", [True, False])
def test_a_change_of_the_picture_size_ends_the_camera(
    camera: MotionJpeg, monkeypatch: pytest.MonkeyPatch, connected: bool
) -> None:
    """Positions depend on the size: the camera's process restarts with the new one."""
    monkeypatch.setattr(stream_reader, "_RETRY_FIRST_S", 0.05)
    port = camera.plug_in()
    source = LiveStream(f"http://127.0.0.1:{port}/", {})

    def take_them_all() -> None:
        while True:
            picture = source.take(0)
            assert picture is None or picture.shape == (HEIGHT, WIDTH, 3)
            time.sleep(0.01)

    try:
        until(lambda: shown(source) == 0)
        if not connected:
            camera.unplug()
        camera.width = 2 * WIDTH
        if not connected:
            camera.plug_in(port)
        with pytest.raises(UnavailableError, match=r"its images are 128x48 now, they were 64x48$"):
            take_them_all()
    finally:
        source.close()


def test_a_camera_that_has_its_earlier_size_again_is_shown(
    camera: MotionJpeg, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without pulses nobody has asked meanwhile."""
    monkeypatch.setattr(stream_reader, "_RETRY_FIRST_S", 0.05)
    source = LiveStream(f"http://127.0.0.1:{camera.plug_in()}/", {})
    try:
        until(lambda: shown(source) == 0)
        camera.width = 2 * WIDTH
        until(lambda: camera.left >= 2)  # the connection in which it changes, and one that is refused
        camera.frame, camera.width = 3, WIDTH
        frames = source._newest
        until(lambda: source._newest is not frames)
        until(lambda: shown(source) == 3)
    finally:
        source.close()


@pytest.mark.parametrize("kind", [av.error.PatchWelcomeError, av.error.ArgumentError])
def test_an_undecodable_picture_does_not_end_the_connection(
    camera: MotionJpeg, kind: type[av.error.FFmpegError]
) -> None:
    """FFmpeg's error for damage depends on the codec."""
    damaged = threading.Event()

    class Damaging(LiveStream):
        connections = 0

        def _decode(self, packet: av.Packet[VideoStream]) -> bool:
            return super()._decode(cast("av.Packet[VideoStream]", Damaged()) if damaged.is_set() else packet)

        def _read(self, opened: OpenedVideo) -> bool:
            self.connections += 1
            return super()._read(opened)

    class Damaged:
        pts = time_base = None

        def decode(self) -> list[VideoFrame]:
            damaged.clear()
            raise kind(1, "not yet implemented")

    source = Damaging(f"http://127.0.0.1:{camera.plug_in()}/", {})
    try:
        until(lambda: shown(source) == 0)
        damaged.set()
        until(lambda: not damaged.is_set())
        camera.frame = 5
        until(lambda: shown(source) == 5)
        assert source.connections == 1
    finally:
        source.close()


def test_a_read_error_ends_the_connection_but_not_the_camera(
    camera: MotionJpeg, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(stream_reader, "_RETRY_FIRST_S", 0.05)

    class FailingOnce(LiveAudioSource):
        connections = 0

        def opened(self, stream: AudioStream | None) -> None:
            self.connections += 1
            if self.connections == 1:
                raise ValueError("unexpected error")
            super().opened(stream)

    listener = FailingOnce(SoundSettings(source="c0"), 25)
    source = LiveStream(f"http://127.0.0.1:{camera.plug_in()}/", {}, listener)
    try:
        until(lambda: shown(source) == 0)
    finally:
        source.close()
    assert listener.connections == 2
    (record,) = [record for record in caplog.records if record.exc_info]
    assert "unexpected error" in str(record.exc_info)


def test_closing_ends_the_thread(camera: MotionJpeg) -> None:
    source = LiveStream(f"http://127.0.0.1:{camera.plug_in()}/", {})
    source.close()
    assert not source._thread.is_alive()


@pytest.mark.parametrize("url", ["http://127.0.0.1:1/", "rtsp://127.0.0.1:1/", "nonsense://door"])
def test_an_unreachable_camera_is_refused_in_one_line(url: str) -> None:
    with pytest.raises(UserError, match="camera door: ") as caught:
        open_source(CameraSettings(id="door", source=url), SiteSettings())
    assert "\n" not in str(caught.value)
    assert url in str(caught.value)


@pytest.mark.parametrize("login", ["me:pa@ss:w@", ""])
def test_no_error_contains_the_password(login: str) -> None:
    with pytest.raises(UserError, match="cannot open this video") as caught:
        open_video(f"rtsp://{login}127.0.0.1:1/user=me_password=w0rd_channel=1", {}, (5.0, 5.0))
    assert "pa@ss" not in str(caught.value)
    assert "w0rd" not in str(caught.value)
    assert "rtsp://127.0.0.1:1/..." in str(caught.value)


def test_options_are_passed_on(camera: MotionJpeg) -> None:
    port = camera.plug_in()
    source = LiveStream(f"http://127.0.0.1:{port}/", {"user_agent": "MyView"})
    source.close()


def test_an_unknown_host_is_distinguished_from_a_failing_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    """FFmpeg reports the same error for both."""

    def refused(*_: object, **__: object) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    def unknown(*_: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(av, "open", refused)
    with pytest.raises(UserError, match=r"127.0.0.1/\.\.\.: .*: Input/output error"):
        open_video("rtsp://127.0.0.1/live")
    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    with pytest.raises(UserError, match=r"rtsp://gate/\.\.\.: .*: Name or service not known"):
        open_video("rtsp://me:hunter2@gate/live")


@pytest.mark.parametrize("scheme", ["rtsp", "http"])
def test_a_camera_that_accepts_and_keeps_silent_does_not_answer(scheme: str) -> None:
    """FFmpeg calls its interrupted RTSP request invalid data."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"{scheme}://127.0.0.1:{silent.getsockname()[1]}/live"
        with pytest.raises(UserError, match=r"cannot open this video: no answer within 0\.3 s$"):
            open_video(address, timeout=(0.3, 0.3))
