"""Repeated failures are one log event, not a line for each frame, message or attempt."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import av
import msgspec
import pytest

from fakes.media.videos import write_video
from fakes.service.fed_site import ServedSite
from fakes.service.rendering import RENDER_SETTINGS, fragments
from fakes.service.scripted_cameras import GOP, small_config
from logthrottle import LogThrottle
from server.camera.audio import LiveAudioSource, RecordedAudioSource, recorded_source
from server.camera.peers.detection_exchange import PeerDetectionExchange
from server.camera.process import CameraProcess
from server.camera.sources import recording
from server.camera.sources.frame_reader import read_frames
from server.camera.sources.recording import Recording
from server.config.sections import SoundSettings
from server.media.rendering_messages import RenderRequest
from server.messaging.camera_status import CameraStatus
from server.messaging.inbox import Message
from server.messaging.messages import FrameDetections, ZenohKeys
from server.service.rendering import rendered_stream as stream_source
from server.service.rendering.decided_boxes import NO_OVERLAY
from server.service.rendering.worker import stream_renderer
from server.service.streaming.broadcaster import Broadcaster
from server.supervisor.site import SiteProcesses
from server.system.worker.process import WorkerDiedError

KEYS = ZenohKeys("hall")


def found(camera: str, pulse: int) -> bytes:
    """Return a message of a camera about a frame."""
    return msgspec.msgpack.encode(
        FrameDetections(camera=camera, boot=1, size=(192, 108), pulse=pulse, boxes=b"")
    )


async def test_repeated_late_messages_are_logged_rarely_and_when_they_end(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level("INFO")
    clock = [0.0]
    exchange = PeerDetectionExchange(small_config(), "c0", None, 10)
    exchange._late_log["c1"] = LogThrottle(lambda: clock[0])
    for pulse in range(3):
        exchange._log_late("c1", pulse)
        exchange._log_in_time("c1")
    clock[0] = 60.0
    exchange._log_late("c1", 1500)
    clock[0] = 120.0
    exchange._log_in_time("c1")
    assert caplog.messages == [
        "camera c0: detections of camera c1 in frame 0 arrived too late",
        "camera c0: detections of camera c1 in frame 1500 arrived too late, and 2 times before",
        "camera c0: detections of camera c1 arrive in time again",
    ]


async def test_invalid_messages_of_a_camera_are_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level("INFO")
    clock = [0.0]
    exchange = PeerDetectionExchange(small_config(), "c0", None, 10)
    for camera in ("c1", "c2"):
        exchange._bad_log[camera] = LogThrottle(lambda: clock[0])

    def hear(camera: str, payload: bytes) -> None:
        exchange._decode(Message(KEYS.camera(camera, "detections"), payload, b""))

    for frame in range(250):
        clock[0] = frame / 25
        hear("c1", msgspec.msgpack.encode({"camera": "c1"}))
        hear("c2", found("c2", frame))
    clock[0] += 60.0
    hear("c1", found("c1", 1750))
    none, well = caplog.messages
    assert none.startswith(
        "camera c0: cannot parse a message on myview/hall/camera/c1/detections: Object missing"
    )
    assert well == "camera c0: messages of camera c1 can be parsed again; 250 could not"
    assert exchange.bad_messages == 250


async def test_messages_that_a_camera_cannot_parse_are_in_its_status(monkeypatch: pytest.MonkeyPatch) -> None:
    config = small_config()
    cameras = [
        camera.model_copy(update={"source": "scene:room?camera=0&objects=1"}) for camera in config.cameras
    ]
    camera = CameraProcess(config.model_copy(update={"cameras": cameras}), "c0")
    published: list[CameraStatus] = []
    monkeypatch.setattr(camera._publisher, "publish_status", published.append)
    camera._exchange._decode(Message(KEYS.camera("c1", "detections"), b"{", b""))
    for _ in range(2):
        camera._corrections.put(Message(KEYS.camera("c0", "position_corrections"), b"{", b""))
    camera._publish_status()
    camera._pipeline.close()
    [status] = published
    assert status.bad_messages == 3


def test_a_camera_without_sound_is_logged_once_for_many_reopenings(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level("INFO")
    sound = LiveAudioSource(SoundSettings(source="c0"), 25.0)
    for _ in range(10):
        sound.opened(None)
    assert caplog.messages == ["the camera sends no audio; the site is silent"]


def test_damage_of_a_looping_recording_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    def demux(_: Any) -> Any:
        raise av.error.InvalidDataError(1, "damaged")

    container = SimpleNamespace(name="hall.mp4", demux=demux)
    opened: Any = SimpleNamespace(container=container, stream=SimpleNamespace(time_base=None), fps=25.0)
    assert not list(read_frames(opened))
    for _ in range(5):
        assert not list(read_frames(opened, quiet=True))
    assert caplog.messages == ["hall.mp4: cannot be read any further: damaged"]


def test_damaged_sound_of_a_looping_recording_is_logged_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def demux(_: Any) -> Any:
        raise av.error.InvalidDataError(1, "damaged")

    container = SimpleNamespace(demux=demux, close=lambda: None)
    monkeypatch.setattr(recorded_source, "_open", lambda _: (container, None))
    sound = RecordedAudioSource.__new__(RecordedAudioSource)
    sound._path, sound._has_warned = "hall.mp4", False
    for _ in range(5):
        assert not list(sound._one_pass())
    assert caplog.messages == ["hall.mp4: its audio cannot be read any further: damaged"]


def test_a_recording_that_repeats_is_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reopened: list[bool] = []

    def noted(opened: Any, *, quiet: bool = False) -> Any:
        reopened.append(quiet)
        return read_frames(opened, quiet=quiet)

    monkeypatch.setattr(recording, "read_frames", noted)
    repeated = Recording(str(write_video(tmp_path / "hall.avi", 3, codec="mjpeg")), 0, "loop")
    for pulse in range(9):
        repeated.take(pulse)
    repeated.close()
    assert reopened == [False, True, True]


def test_frames_that_cannot_be_decoded_are_logged_once_per_stream(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    class Damaged:
        def decode(self, _: Any) -> Any:
            raise av.error.InvalidDataError(1, "damaged")

    monkeypatch.setattr(stream_renderer, "_decoder", lambda _: Damaged())
    rendering = stream_renderer.StreamRenderer(RENDER_SETTINGS)
    for gop in range(3):
        rendering.render(RenderRequest(fragments=fragments(gop * GOP, GOP)))
    assert len(caplog.messages) == 1
    assert caplog.messages[0].startswith("frame 0 cannot be decoded: ")


async def test_render_workers_that_die_repeatedly_are_counted_and_logged_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(stream_source, "_RETRY_FIRST_S", 0.0)
    monkeypatch.setattr(stream_source, "_RETRY_MAX_S", 0.0)
    rendering = stream_source.RenderedStream(
        "object 1", Broadcaster, lambda _: NO_OVERLAY, RENDER_SETTINGS, live=True, queue_gops=4
    )

    async def dies() -> None:
        await asyncio.sleep(0)
        if rendering.restarts < 10:
            raise WorkerDiedError("died")

    monkeypatch.setattr(rendering, "_run_worker", dies)
    await rendering.run()
    assert rendering.restarts == 10
    assert caplog.messages == ["rendering object 1: the worker died; starting another"]


async def test_a_server_error_is_logged_once_for_many_requests(
    served: ServedSite, caplog: pytest.LogCaptureFixture
) -> None:
    served.service.loss_recorder = None  # type: ignore[assignment]
    with caplog.at_level(logging.WARNING):
        for _ in range(5):
            async with served.session.get("/metrics") as answer:
                assert answer.status == 500
    assert caplog.messages == ["answering GET /metrics failed"]
    assert caplog.records[0].exc_info


def test_an_unwritable_folder_is_logged_once_for_many_starts(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("")
    running: Any = SimpleNamespace(path=tmp_path / "site.yaml", now=small_config())
    processes = SiteProcesses(running, tmp_path / "file" / "folder", {})
    for _ in range(5):
        processes.write_active_config()
    assert len(caplog.messages) == 1
    assert "cannot write the running configuration" in caplog.messages[0]
