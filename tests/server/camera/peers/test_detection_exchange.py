"""Cameras of the same ground exchange detections, live as offline; an absent camera hardly delays others."""

from __future__ import annotations

import asyncio
import csv
import threading
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.service.camera_processes import SiteInOneLoop, written_files
from fakes.timeouts import PATIENCE
from server.camera.peers.cross_view_scorer import CrossViewScorer, PeerDetections
from server.camera.peers.detection_exchange import PeerDetectionExchange
from server.camera.pipeline import CameraPipeline
from server.cli.generated_config import free_port
from server.cli.render.camera_workers import CameraWorkers, EpochBatch, run_cameras
from server.cli.render.renderer import Renderer
from server.config.loader import build_config
from server.config.sections.site import ZenohSettings
from server.config.site_config import Config
from server.messaging.bus import Bus
from server.messaging.messages import FrameDetections, ZenohKeys
from server.messaging.packed_arrays import FRAME_DETECTIONS_MAX, pack_detections, unpack_detections
from synthetic import Scene, write_recording
from tracking import Detections

FRAMES = 40
FPS = 50.0
WAIT = 1.0  # seconds that cameras wait for peers; the third one never connects


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three views of a room with people in it, small and short."""
    out = tmp_path_factory.mktemp("recordings") / "room"
    write_recording(Scene("room", 3, 4, 4, 192, 108, FPS), out, FRAMES / FPS)
    return out


def config_of(
    recording: Path,
    views: int = 3,
    *,
    use: bool = True,
    wait: float = PATIENCE,
    ahead: bool = True,
    **offsets: int,
) -> Config:
    """Return a site of the room's views on free ports, with offsets by camera."""
    bus = f"tcp/127.0.0.1:{free_port()}"
    cameras = [
        {"id": f"c{n}", "source": f"c{n}.mp4", "offset_s": offsets.get(f"c{n}", 0) / FPS}
        for n in range(views)
    ]
    content: dict[str, Any] = {
        "site": {"name": "hall", "fps": FPS, "width": 192, "height": 108},
        "sync": {"port": free_port(), "start_timeout_s": PATIENCE},
        "zenoh": {"connect": bus, "listen": bus},
        "cameras": cameras,
        "detect": {} if ahead else {"prescan_s": 0, "median": {"bootstrap_s": 1.0}},
        "ground": "ground.json",
        "track": {
            "backlog_s": PATIENCE,
            "cross_view": {"enabled": use},
            "cross_view_wait_s": wait,
            "joint": False,
        },
        "view": {"late_after_s": PATIENCE},
    }
    return build_config(content, where="hall", folder=recording)


def run_offline(config: Config, folder: Path) -> dict[str, bytes]:
    """Run all cameras in step in this process; return the written files."""
    folder.mkdir()
    renderer = Renderer(config, folder)
    for batch in run_cameras({camera: CameraPipeline(config, camera) for camera in config.camera_ids}):
        renderer.take(batch)
    renderer.finish()
    return written_files(folder)


@pytest.fixture
async def running() -> AsyncIterator[list[SiteInOneLoop]]:
    sites: list[SiteInOneLoop] = []
    yield sites
    for site in sites:
        await site.stop()


async def run_live(config: Config, out: Path, running: list[SiteInOneLoop]) -> dict[str, bytes]:
    """Run a whole site to its end; return the written files."""
    whole_site = SiteInOneLoop(config, out)
    running.append(whole_site)
    over = await whole_site.start()
    cameras = [whole_site.camera(camera) for camera in config.camera_ids]
    async with asyncio.timeout(PATIENCE):
        await asyncio.gather(over, *cameras)
    return written_files(out)


@pytest.mark.slow
async def test_live_equals_offline_for_any_message_order(
    recording: Path, tmp_path: Path, running: list[SiteInOneLoop]
) -> None:
    config = config_of(recording, 2, c1=7)
    live = await run_live(config, tmp_path / "live", running)
    offline = run_offline(config, tmp_path / "offline")
    assert live == offline
    assert live["late.csv"] == b"frame,camera,reason\n"


def test_peer_detections_change_scores_and_piped_workers_agree(recording: Path) -> None:
    config = config_of(recording, 2, c1=7)
    workers = CameraWorkers(config)
    workers.start()
    try:
        piped = list(workers)
    finally:
        workers.close()
    assert sorted(piped, key=_order) == batches_in_step(config)
    assert sorted(piped, key=_order) != batches_in_step(config_of(recording, 2, use=False, c1=7))


def batches_in_step(config: Config) -> list[EpochBatch]:
    batches = run_cameras({camera: CameraPipeline(config, camera) for camera in config.camera_ids})
    return sorted(batches, key=_order)


def _order(batch: EpochBatch) -> tuple[str, int]:
    return batch.camera, batch.tracks.epoch if batch.tracks else -1


async def test_a_camera_that_never_connects_is_logged_and_does_not_delay_others(
    recording: Path, tmp_path: Path, running: list[SiteInOneLoop]
) -> None:
    # A wait for every frame would exceed the timeout.
    config = config_of(recording, wait=1.2 * PATIENCE / FRAMES)
    whole_site = SiteInOneLoop(config, tmp_path / "out")
    whole_site.pulses = type(whole_site.pulses)(
        50, expect={"bestview", "c0", "c1"}, start_timeout=PATIENCE, port=config.sync.port
    )
    running.append(whole_site)
    await whole_site.start()
    async with asyncio.timeout(PATIENCE):
        await asyncio.gather(whole_site.camera("c0"), whole_site.camera("c1"))
    with (tmp_path / "out" / "late.csv").open(encoding="ascii", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["camera"] for row in rows if row["reason"] == "no peer detections"} <= {"c0", "c1"}


@pytest.fixture
async def pair(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[tuple[Bus, PeerDetectionExchange, PeerDetectionExchange]]:
    """The router, and two of the three cameras on the bus."""
    monkeypatch.setattr("server.camera.peers.detection_exchange._LISTENERS_S", WAIT / 4)
    config = config_of(recording, wait=WAIT)
    router = Bus.router(config.zenoh)
    exchanges = [
        PeerDetectionExchange(config, camera, CrossViewScorer(config, camera, (192, 108), 1), 100)
        for camera in ("c0", "c1")
    ]
    for exchange in exchanges:
        await exchange.join()
    yield router, *exchanges
    for exchange in exchanges:
        await exchange.leave()
    router.close()


def now() -> float:
    return asyncio.get_running_loop().time()


def detections(camera: str, pulse: int) -> FrameDetections:
    box = pack_detections(np.array([[1.5, 2.0, 20.25, 60.0]]), np.array([0.5]))
    return FrameDetections(camera=camera, boot=1, size=(192, 108), pulse=pulse, boxes=box)


async def exchange_both(
    one: PeerDetectionExchange, two: PeerDetectionExchange, pulse: int = 0, *, needed: bool = True
) -> list[PeerDetections]:
    """Let two cameras exchange the detections of a frame."""
    pair = (("c0", one), ("c1", two))
    return await asyncio.gather(
        *(exchange.exchange(pulse, detections(name, pulse), now(), needed=needed) for name, exchange in pair)
    )


async def test_detections_are_exchanged_from_the_first_frame(
    pair: tuple[Bus, PeerDetectionExchange, PeerDetectionExchange],
) -> None:
    _, one, two = pair
    for pulse in range(5):
        first, second = await exchange_both(one, two, pulse)
        assert first.messages == (detections("c1", pulse),)
        assert second.messages == (detections("c0", pulse),)


async def test_a_camera_that_connects_slowly_misses_no_detections(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    may_connect, listener = threading.Event(), Bus.peer_listener

    def slow_listener(settings: ZenohSettings, user: str | None = None) -> Bus:
        if user == "c1":
            may_connect.wait()
        return listener(settings, user)

    monkeypatch.setattr(Bus, "peer_listener", slow_listener)
    monkeypatch.setattr("server.camera.peers.detection_exchange._LISTENERS_S", 0.0)
    config = config_of(recording, 2)
    router = Bus.router(config.zenoh)
    cameras = {
        name: PeerDetectionExchange(config, name, CrossViewScorer(config, name, (192, 108), 1), 100)
        for name in ("c0", "c1")
    }

    async def exchange_first_frame(name: str) -> PeerDetections:
        await cameras[name].join()
        if name == "c0":
            asyncio.get_running_loop().call_soon(may_connect.set)  # runs when the exchange waits
        return await cameras[name].exchange(0, detections(name, 0), now(), needed=True)

    exchanges = [asyncio.create_task(exchange_first_frame(name)) for name in cameras]
    async with asyncio.timeout(PATIENCE):
        first, second = await asyncio.gather(*exchanges)
    assert first.messages == (detections("c1", 0),)
    assert second.messages == (detections("c0", 0),)
    for camera in cameras.values():
        await camera.leave()
    router.close()


async def test_an_unexpected_error_on_joining_ends_the_camera(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> Bus:
        raise MemoryError("no memory")

    monkeypatch.setattr(Bus, "peer_listener", fail)
    config = config_of(recording, wait=WAIT)
    exchange = PeerDetectionExchange(config, "c0", CrossViewScorer(config, "c0", (192, 108), 1), 100)
    await exchange.join()
    with pytest.raises(MemoryError, match="no memory"):
        await exchange.exchange(0, detections("c0", 0), now(), needed=True)
    await exchange.leave()


async def test_a_disconnected_camera_is_waited_for_once(
    pair: tuple[Bus, PeerDetectionExchange, PeerDetectionExchange],
) -> None:
    _, one, two = pair
    await exchange_both(one, two, needed=True)
    await two.leave()
    began = asyncio.get_running_loop().time()
    for pulse in range(1, 100):
        assert (await one.exchange(pulse, detections("c0", pulse), now(), needed=True)).is_incomplete
    assert asyncio.get_running_loop().time() - began < 50 * WAIT


async def test_invalid_messages_are_counted_and_ignored(
    pair: tuple[Bus, PeerDetectionExchange, PeerDetectionExchange],
) -> None:
    _, one, two = pair
    await exchange_both(one, two, needed=False)
    key = ZenohKeys("hall").camera("c1", "detections")
    assert two._buses
    far = msgspec.msgpack.encode(detections("c0", 1))
    for payload in (b"", b"{", b"[1]", b'{"camera": "c1"}', far, b"\xff\xfe"):
        two._buses[0].publish(key, payload)
    await two.exchange(1, detections("c1", 1), now(), needed=False)
    assert (await one.exchange(1, detections("c0", 1), now(), needed=True)).messages == (detections("c1", 1),)
    assert one.bad_messages == 6


NUMBER = st.floats() | st.integers(-(2**70), 2**70) | st.text(max_size=3) | st.none()
BYTES = st.binary(max_size=50) | st.lists(st.floats(width=32), min_size=5, max_size=5).map(
    lambda row: np.array(row, dtype="<f4").tobytes()
)
ROWS = st.lists(st.lists(NUMBER, min_size=4, max_size=6), max_size=4) | NUMBER


@settings(deadline=None, max_examples=100)
@given(
    st.fixed_dictionaries(
        {"camera": st.just("c1"), "boot": NUMBER, "size": ROWS, "pulse": NUMBER, "boxes": BYTES}
    ),
    st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 4, st.floats(0, 1)), max_size=FRAME_DETECTIONS_MAX),
)
def test_every_decoded_message_can_be_used_for_scoring(message: dict[str, Any], boxes: list[Any]) -> None:
    config = _room()
    cross_view = CrossViewScorer(config, "c0", (640, 360), 1)
    rows = np.array(boxes).reshape(-1, 5)
    packed = pack_detections(rows[:, :4], rows[:, 4])
    found = Detections(np.array([[300.0, 100.0, 340.0, 220.0]]), np.array([0.5]), np.ones((1, 1)))
    good = {"camera": "c1", "boot": 1, "size": [640, 360], "pulse": 3, "boxes": packed}
    for content in (message, {**good, "boxes": message["boxes"]}, {**good, "size": message["size"]}, good):
        try:
            decoded = msgspec.msgpack.decode(msgspec.msgpack.encode(content), type=FrameDetections)
        except (msgspec.ValidationError, msgspec.DecodeError, OverflowError):
            assert content is not good
            continue
        if not cross_view.view_overlaps(decoded):
            continue
        [score] = cross_view.rescore(found, [decoded]).scores
        assert 0.0 <= score <= 1.0


def _room() -> Config:
    matrices = (
        [[0.01, 0, -3], [0, 0.02, -2], [0, 0.002, 0.1]],
        [[0.01, 0.001, -3], [0, 0.02, -2], [0, 0.002, 0.1]],
    )
    cameras = [{"id": f"c{n}", "source": "x.mp4", "ground": ground} for n, ground in enumerate(matrices)]
    return build_config({"cameras": cameras}, where="room", folder=Path())


def test_only_the_most_confident_boxes_are_sent_in_order() -> None:
    config = _room()
    boxes = np.arange(4 * 150, dtype=np.float64).reshape(150, 4)
    scores = np.arange(150) % 101 / 100
    message = CrossViewScorer(config, "c0", (640, 360), 1).build_message(
        5, Detections(boxes, scores, np.empty((150, 0)))
    )
    assert message.boxes is not None
    corners, sent = unpack_detections(message.boxes)
    assert len(sent) == FRAME_DETECTIONS_MAX
    assert corners[:, 0].tolist() == sorted(corners[:, 0])
    left_out = sorted(scores)[: 150 - FRAME_DETECTIONS_MAX]
    assert sorted([*sent, *left_out]) == pytest.approx(sorted(scores))


def test_frames_without_detection_are_not_sent_as_empty(recording: Path) -> None:
    config = config_of(recording, ahead=False)
    pipeline = CameraPipeline(config, "c0")
    has_boxes = []
    for pulse in range(40):
        searched = pipeline.detect(pulse, None if pulse == 35 else pipeline.take(pulse))
        assert searched.message is not None
        has_boxes.append(searched.message.boxes is not None)
        pipeline.track_detections(searched, PeerDetections())
    pipeline.close()
    first = has_boxes.index(True)
    assert 0 < first < 35, "the background is learned first"
    assert [pulse for pulse, is_detected in enumerate(has_boxes) if not is_detected] == [*range(first), 35]


def test_frames_without_peer_detections_are_reported(recording: Path) -> None:
    config = config_of(recording)
    pipeline = CameraPipeline(config, "c0")
    needing_peers, reported = [], []
    for pulse in range(FRAMES):
        searched = pipeline.detect(pulse, pipeline.take(pulse))
        if searched.depends_on_peers:
            needing_peers.append(pulse)
        tracks = pipeline.track_detections(searched, PeerDetections(is_incomplete=True))
        reported += tracks.without_peers if tracks else []
    reported += pipeline.finish(FRAMES).without_peers
    pipeline.close()
    assert needing_peers
    assert reported == needing_peers


def test_a_site_with_fewer_than_two_homographies_has_no_peers(recording: Path) -> None:
    config = config_of(recording)
    uncalibrated = [camera.model_copy(update={"ground": None}) for camera in config.cameras]
    for cameras in (uncalibrated, [config.cameras[0], *uncalibrated[1:]]):
        single = config.model_copy(update={"cameras": cameras})
        assert not any(single.peers_of(camera) for camera in single.camera_ids)
        pipeline = CameraPipeline(single, "c0")
        assert pipeline.detect(0, pipeline.take(0)).message is None
        assert pipeline.end_message(1) is None
        pipeline.close()
    assert config.peers_of("c1") == ("c0", "c2")
    assert not config_of(recording, use=False).peers_of("c1")


async def test_detections_are_exchanged_over_another_router_while_one_is_down(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.camera.peers.detection_exchange._LISTENERS_S", WAIT / 4)
    config = config_of(recording, wait=WAIT)
    listens = [config.zenoh.listen, f"tcp/127.0.0.1:{free_port()}"]
    zenoh = [ZenohSettings(listen=listen, connect=listens) for listen in listens]
    routers = [Bus.router(settings) for settings in zenoh]
    config = config.model_copy(update={"zenoh": zenoh[0]})
    one, two = exchanges = [
        PeerDetectionExchange(config, camera, CrossViewScorer(config, camera, (192, 108), 1), 100)
        for camera in ("c0", "c1")
    ]
    for exchange in exchanges:
        await exchange.join()
    for pulse in range(10):
        if pulse == 5:
            routers[0].close()
        first, second = await exchange_both(one, two, pulse)
        assert first.messages == (detections("c1", pulse),)
        assert second.messages == (detections("c0", pulse),)
    for exchange in exchanges:
        await exchange.leave()
    routers[1].close()
