"""A camera and the best-view service over a real bus and real pulses, in one event loop."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import AsyncIterator
from itertools import pairwise, zip_longest
from pathlib import Path

import msgspec
import pytest
import zenoh
from msgspec.msgpack import decode

from fakes.media.videos import write_video
from fakes.service.camera_processes import FPS, SiteInOneLoop, written_files
from fakes.timeouts import PATIENCE
from server.camera.load.load_monitor import LoadMonitor
from server.camera.load.load_shedder import LevelBounds, LoadShedder, shed_levels
from server.camera.pipeline import CameraPipeline
from server.cli.generated_config import free_port
from server.cli.render.camera_workers import run_camera
from server.cli.render.renderer import Renderer
from server.config.loader import build_config
from server.config.site_config import Config
from server.messaging.camera_status import CameraStatus
from server.messaging.messages import CameraTracks, FrameHeader, GopChoices
from server.service.bus_connection import BusConnection
from synthetic import Scene, write_recording

FRAMES = 60
WINDOW = {"length_s": 15 / FPS, "stride_s": 5 / FPS, "birth_s": 15 / FPS}


def site(folder: Path, **cameras: str) -> Config:
    """Return a small and fast site of recordings, on free ports."""
    bus = f"tcp/127.0.0.1:{free_port()}"
    content = {
        "site": {"name": "hall", "fps": FPS, "width": 128, "height": 72},
        "sync": {"port": free_port(), "start_timeout_s": PATIENCE},
        "zenoh": {"connect": bus, "listen": bus},
        "cameras": [{"id": camera, "source": source} for camera, source in cameras.items()],
        "track": {"backlog_s": PATIENCE, "window": WINDOW},
        "view": {
            "late_after_s": PATIENCE,
            "identity": {"confirmation_s": 0.5, "clustering_interval_s": 0.2},
        },
    }
    return build_config(content, where="hall", folder=folder)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("recordings") / "room"
    write_recording(Scene("room", 2, 2, 4, 128, 72, FPS), out, FRAMES / FPS)
    return out


@pytest.fixture
async def running() -> AsyncIterator[list[SiteInOneLoop]]:
    sites: list[SiteInOneLoop] = []
    yield sites
    for site in sites:
        await site.stop()


class ZenohSubscriber:
    """A zenoh subscriber without MyView's code."""

    def __init__(self, config: Config, key: str) -> None:
        settings = zenoh.Config()
        settings.insert_json5("mode", '"client"')
        settings.insert_json5("connect/endpoints", f'["{config.zenoh.listen}"]')
        settings.insert_json5("scouting/multicast/enabled", "false")
        self.samples: list[tuple[str, bytes, bytes]] = []
        self._received = threading.Condition()
        self._session = zenoh.open(settings)
        self._subscriber = self._session.declare_subscriber(key, self._receive)

    def _receive(self, sample: zenoh.Sample) -> None:
        head = sample.attachment.to_bytes() if sample.attachment is not None else b""
        with self._received:
            self.samples.append((str(sample.key_expr), sample.payload.to_bytes(), head))
            self._received.notify_all()

    def wait_and_close(self, key_end: str, count: int) -> None:
        with self._received:
            assert self._received.wait_for(lambda: len(self.of(key_end)) >= count, PATIENCE)
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]
        self._session.close()  # type: ignore[no-untyped-call]

    def of(self, key_end: str) -> list[tuple[bytes, bytes]]:
        return [(payload, head) for key, payload, head in self.samples if key.endswith(key_end)]


def render_offline(config: Config, folder: Path) -> dict[str, bytes]:
    """Render the same recordings offline; return the written files."""
    folder.mkdir()
    renderer = Renderer(config, folder)
    workers = [run_camera(CameraPipeline(config, camera), camera) for camera in config.camera_ids]
    for batches in zip_longest(*workers):
        for batch in batches:
            if batch is not None:
                renderer.take(batch)
    renderer.finish()
    return written_files(folder)


async def test_recordings_run_to_their_end_without_losses(
    recording: Path, tmp_path: Path, running: list[SiteInOneLoop]
) -> None:
    config = site(recording, c0="c0.mp4", c1="c1.mp4")
    whole_site = SiteInOneLoop(config, tmp_path / "out")
    running.append(whole_site)
    gops: list[GopChoices] = []
    whole_site.service.on_decision.append(gops.append)
    over = await whole_site.start()
    subscriber = await asyncio.to_thread(ZenohSubscriber, config, "myview/**")
    cameras = [whole_site.camera(camera) for camera in config.camera_ids]
    async with asyncio.timeout(PATIENCE):
        await asyncio.gather(over, *cameras)
    await asyncio.to_thread(subscriber.wait_and_close, "bestview/choices", len(gops))

    for camera in config.camera_ids:
        frame_buffer = whole_site.service.frame_buffers[camera]
        assert [pulse for pulse in range(FRAMES + 5) if frame_buffer.has(pulse)] == list(range(FRAMES))
        assert whole_site.service.ingest.states[camera].label == "ended"
        assert whole_site.service.ingest.states[camera].bad_messages == 0
    assert sum(gop.frames for gop in gops) == FRAMES
    written = written_files(tmp_path / "out")
    assert written["late.csv"] == b"frame,camera,reason\n"
    assert written["choices.csv"].count(b"\n") > 1, "a person is shown"
    assert written == render_offline(config, tmp_path / "offline"), "live output equals offline output"

    frames = [decode(head, type=FrameHeader) for _, head in subscriber.of("c0/video")]
    assert [frame.pulse for frame in frames] == list(range(FRAMES))
    assert all(frame.due <= frame.encoded and frame.captured_at <= frame.encoded for frame in frames)
    messages = [decode(payload, type=CameraTracks) for payload, _ in subscriber.of("c0/tracks")]
    assert [message.epoch for message in messages] == list(range(FRAMES // 5 + 1))
    assert messages[-1].ended
    assert messages[0].solved_at > 0
    published = [
        msgspec.json.decode(payload, type=GopChoices) for payload, _ in subscriber.of("bestview/choices")
    ]
    assert published == gops
    statuses = [decode(payload, type=CameraStatus) for payload, _ in subscriber.of("c0/status")]
    assert statuses[-1].state == "ended"
    assert statuses[-1].missed == 0


@pytest.mark.parametrize("confirms", [True, False])
async def test_a_camera_stays_connected_until_the_service_has_its_last_tracks(
    recording: Path,
    tmp_path: Path,
    running: list[SiteInOneLoop],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    *,
    confirms: bool,
) -> None:
    """zenoh sends that a session ends ahead of tracks that wait, and nobody waits for a lost camera's."""
    connected: list[bool] = []
    confirm = BusConnection.confirm_end

    def confirm_or_not(bus: BusConnection, camera: str, boot: int) -> None:
        connected.append(whole_site.service.ingest.states[camera].alive)
        if confirms:
            confirm(bus, camera, boot)

    monkeypatch.setattr(BusConnection, "confirm_end", confirm_or_not)
    monkeypatch.setattr("server.camera.process._END_CONFIRMED_WITHIN_S", PATIENCE if confirms else 0.0)
    whole_site = SiteInOneLoop(site(recording, c0="c0.mp4"), tmp_path / "out")
    running.append(whole_site)
    over = await whole_site.start()
    async with asyncio.timeout(PATIENCE):
        await asyncio.gather(over, whole_site.camera("c0"))
    assert connected == [True] or not confirms, "without confirmation it leaves at once"
    assert ("did not confirm the last tracks" in caplog.text) is not confirms


async def test_a_disconnected_camera_is_detected_and_others_continue(
    tmp_path: Path, running: list[SiteInOneLoop]
) -> None:
    config = site(tmp_path, c0="scene:room?camera=0&objects=1", c1="scene:room?camera=1&objects=1")
    whole_site = SiteInOneLoop(config)
    running.append(whole_site)
    decided = asyncio.Event()
    whole_site.service.on_decision.append(lambda _: decided.set())
    await whole_site.start()
    _, second = whole_site.camera("c0"), whole_site.camera("c1")
    states = whole_site.service.ingest.states
    async with asyncio.timeout(PATIENCE):
        await decided.wait()
        second.cancel()
        await asyncio.gather(second, return_exceptions=True)
        while states["c1"].label != "gone":
            decided.clear()
            await decided.wait()
        decided.clear()
        await decided.wait()
    assert states["c0"].label == "live"


async def test_setting_the_wall_clock_does_not_affect_measurements(
    tmp_path: Path, running: list[SiteInOneLoop], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some machines get the time only minutes after the start."""
    whole_site = SiteInOneLoop(site(tmp_path, c0="scene:room?camera=0&objects=1"))
    running.append(whole_site)
    decided = asyncio.Event()
    whole_site.service.on_decision.append(lambda _: decided.set())
    await whole_site.start()
    whole_site.camera("c0")
    clock = time.time
    async with asyncio.timeout(PATIENCE):
        await decided.wait()
        monkeypatch.setattr(time, "time", lambda: clock() + 3600)
        for _ in range(4):
            decided.clear()
            await decided.wait()
    metrics = whole_site.service.ingest.states["c0"].metrics
    for spread in (metrics.sync_error, metrics.tracking_delay):
        assert spread is not None
        assert abs(spread.worst) < PATIENCE


async def test_cameras_and_services_authenticate_to_the_pulse_server(
    tmp_path: Path, running: list[SiteInOneLoop]
) -> None:
    (tmp_path / "users").write_text("".join(f"{name}:{name * 8}\n" for name in ("c0", "bestview")))
    config = site(tmp_path, c0="scene:room?objects=1")
    config = config.model_copy(update={"sync": config.sync.model_copy(update={"users": tmp_path / "users"})})
    whole_site = SiteInOneLoop(config)
    running.append(whole_site)
    decided = asyncio.Event()
    whole_site.service.on_decision.append(lambda _: decided.set())
    await whole_site.start()
    whole_site.camera("c0")
    async with asyncio.timeout(PATIENCE):
        await decided.wait()
    assert {client.name for client in whole_site.pulses.clients()} == {"c0", "bestview"}
    assert whole_site.pulses.refused == 0


@pytest.mark.parametrize(
    "function", ["pipeline.CameraPipeline.track_detections", "status_meter.StatusMeter.status"]
)
async def test_an_internal_error_ends_the_camera(
    tmp_path: Path, running: list[SiteInOneLoop], monkeypatch: pytest.MonkeyPatch, function: str
) -> None:
    config = site(tmp_path, c0="scene:room?objects=1")
    whole_site = SiteInOneLoop(config)
    running.append(whole_site)
    await whole_site.start()

    def fail(*_: object) -> None:
        raise ArithmeticError("internal error")

    monkeypatch.setattr(f"server.camera.{function}", fail)
    async with asyncio.timeout(PATIENCE):
        with pytest.raises(ArithmeticError):
            await whole_site.camera("c0")


async def test_the_site_ends_with_a_camera_restarted_after_the_end_of_its_recording(
    tmp_path: Path, running: list[SiteInOneLoop]
) -> None:
    write_video(tmp_path / "short.mp4", 20)
    write_video(tmp_path / "long.mp4", 25)
    config = site(tmp_path, c0="short.mp4", c1="long.mp4")
    whole_site = SiteInOneLoop(config)
    running.append(whole_site)
    over = await whole_site.start()
    first, second = whole_site.camera("c0"), whole_site.camera("c1")
    async with asyncio.timeout(PATIENCE):
        while whole_site.service.frame_buffers["c0"].newest < 10:  # noqa: ASYNC110 — no event reports frames
            await asyncio.sleep(0.01)
        first.cancel()  # killed before it reports its end
        await second
        await whole_site.camera("c0")
        await over
    assert whole_site.service.ingest.states["c0"].label == "ended"


class Overloaded(LoadMonitor):
    """A load monitor fixed at the highest level."""

    def __init__(self, config: Config, camera_id: str, *, live: bool, has_network: bool = False) -> None:
        super().__init__(config, camera_id, live=live, has_network=has_network)
        self._shedder = LoadShedder(shed_levels(config.window.stride, live=True)[-1:], LevelBounds(1e9, 1e9))

    @property
    def level(self) -> int:
        return 5


async def test_at_the_highest_shedding_level_every_gop_and_window_is_complete(
    recording: Path, tmp_path: Path, running: list[SiteInOneLoop], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.camera.process.LoadMonitor", Overloaded)
    config = site(recording, c0="c0.mp4", c1="c1.mp4")
    whole_site = SiteInOneLoop(config, tmp_path / "out")
    running.append(whole_site)
    gops: list[GopChoices] = []
    whole_site.service.on_decision.append(gops.append)
    over = await whole_site.start()
    subscriber = await asyncio.to_thread(ZenohSubscriber, config, "myview/**")
    async with asyncio.timeout(PATIENCE):
        await asyncio.gather(over, *(whole_site.camera(camera) for camera in config.camera_ids))
    await asyncio.to_thread(subscriber.wait_and_close, "bestview/choices", len(gops))

    heads = [decode(head, type=FrameHeader) for _, head in subscriber.of("c0/video")]
    frames = [head.pulse for head in heads]
    assert frames[:6] == [0, 4, 8, 9, 12, 14]
    assert [head.pulse for head in heads if head.key] == list(range(0, FRAMES, config.gop))
    pairs = [(before.pulse, head.reference_pulse) for before, head in pairwise(heads) if not head.key]
    assert all(before == after for before, after in pairs), "a frame that was not captured affects no other"
    messages = [decode(payload, type=CameraTracks) for payload, _ in subscriber.of("c0/tracks")]
    assert [message.epoch for message in messages] == list(range(FRAMES // 5 + 1))
    assert sorted(pulse for message in messages for pulse in message.shed) == [
        number for number in range(FRAMES) if number % 5 != 4
    ], "all but the last of every window"
    assert sum(gop.frames for gop in gops) == FRAMES
    assert b"no detection" in written_files(tmp_path / "out")["late.csv"]
    statuses = [decode(payload, type=CameraStatus) for payload, _ in subscriber.of("c0/status")]
    assert statuses[-1].load_level == 5
    assert "detecting in every 5th frame" in statuses[-1].load
