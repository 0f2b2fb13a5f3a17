"""One camera's process: on every pulse it captures a frame, encodes, publishes and tracks it."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from statistics import fmean
from typing import TypeVar

import msgspec

from camsync import ClientSettings, Pulse, PulseClient, steady_unix_clock
from server.camera.audio import LiveAudioSource, consecutive_runs, open_site_audio
from server.camera.load.load_monitor import LoadMonitor
from server.camera.operator_corrections import CorrectionInbox
from server.camera.peers.detection_exchange import PeerDetectionExchange
from server.camera.pipeline import CameraPipeline
from server.camera.retained_identity_snapshot import RetainedIdentitySnapshot
from server.camera.sources import Image, SourceEndedError
from server.camera.status_meter import StatusMeter
from server.camera.thumbnails import encode_thumbnails
from server.config.pulse_access import pulse_client_tls, pulse_credentials
from server.config.site_config import Config
from server.messaging.bus import Bus
from server.messaging.messages import (
    AudioHeader,
    CameraState,
    CameraStatus,
    CameraTracks,
    FrameHeader,
    ThumbnailHeader,
    ZenohKeys,
)
from server.system.address_redaction import redact_zenoh_endpoint

log = logging.getLogger(__name__)

T = TypeVar("T")

_STATUS_EVERY_S = 1.0
_FRAMES_PER_IMAGE = 10
"""Frames that may wait for tracking per image that may wait; further ones count as missed."""


@dataclass(frozen=True, slots=True, eq=False)
class _QueuedFrame:
    """A frame in the queue to the tracker.

    Attributes:
        pulse: its pulse.
        image: None: there was none, or it was shed.
        captured: when it was captured, by the loop's clock.
        due: when its pulse was due, likewise.
        skipped: whether load shedding left it out.
    """

    pulse: int
    image: Image | None
    captured: float
    due: float
    skipped: bool = False


class CameraProcess:
    """Runs a camera's pipeline on the pulses, in two threads: video must never wait for tracking.

    Raises:
        UserError: the source cannot be opened, or the password for the pulses cannot be read.
    """

    def __init__(self, config: Config, camera_id: str) -> None:
        self._config, self._id = config, camera_id
        self._pulse_credentials = pulse_credentials(config, camera_id)
        self._pulse_tls = pulse_client_tls(config)
        self._boot = time.time_ns() // 1_000_000
        self._clock = steady_unix_clock()  # of pulses and of all times relative to them
        self._keys = ZenohKeys(config.site.name)
        self._audio = open_site_audio(config, camera_id)
        listener = self._audio if isinstance(self._audio, LiveAudioSource) else None
        self._pipeline = CameraPipeline(config, camera_id, self._boot, listener)
        if self._pipeline.is_passthrough:
            log.info("camera %s: its own H.264 is passed through", camera_id)
        elif self._pipeline.why_encoded:
            log.warning("camera %s is re-encoded: its own H.264: %s", camera_id, self._pipeline.why_encoded)
        self._video = ThreadPoolExecutor(1, "video")
        self._tracking = ThreadPoolExecutor(1, "tracking")
        fps = config.site.fps
        self._images_max = max(1, round(config.track.backlog_s * fps))
        self._backlog: asyncio.Queue[_QueuedFrame | None] = asyncio.Queue(
            maxsize=_FRAMES_PER_IMAGE * self._images_max
        )
        # Passthrough frames depend on each other, and recordings are shown completely: neither drops frames.
        live = not (self._pipeline.source.recorded or self._pipeline.is_passthrough)
        self._load = LoadMonitor(config, camera_id, live=live)
        self._exchange = PeerDetectionExchange(
            config, camera_id, self._pipeline.cross_view, self._backlog.maxsize
        )
        self._corrections = CorrectionInbox(camera_id, self._boot)
        self._meter = StatusMeter(fps)
        self._state: CameraState = "starting"
        self._end = 0
        """The first pulse after the recording, once that has ended."""
        self._bus: Bus | None = None

    async def run(self) -> None:
        """Run until the recording ends; a live camera never does."""
        self._bus = bus = Bus.client(self._config.zenoh, self._id)
        try:
            if self._config.track.assist.enabled:
                bus.subscribe(self._keys.camera(self._id, "position_corrections"), self._corrections.put)
            retained = RetainedIdentitySnapshot(partial(self._publish, "retained_identities"))
            bus.subscribe(self._keys.camera(self._id, "identities"), retained.replace)
            bus.watch_alive(self._keys.bestview("**"), lambda _, is_present: retained.on_service(is_present))
            await self._wait_for_bestview(bus)
            bus.declare_alive(self._keys.camera(self._id, "alive"))
            await self._exchange.join()
            video = asyncio.create_task(self._follow_pulses(), name="pulses")
            tracking = asyncio.create_task(self._track(), name="track")
            status = asyncio.create_task(self._send_status_periodically(), name="status")
            tasks = (video, tracking, status)
            try:
                await self._wait_until_done(video, tracking, status)
                self._send_status()
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
        finally:
            try:
                await self._exchange.leave()
            finally:
                bus.close()  # otherwise the process would not exit
            self._video.shutdown(wait=True)
            self._tracking.shutdown(wait=True)
            self._pipeline.close()

    @staticmethod
    async def _wait_until_done(
        video: asyncio.Task[None], tracking: asyncio.Task[None], status: asyncio.Task[None]
    ) -> None:
        """Wait for video and tracking to end; raise the error of any task."""
        pending = {video, tracking, status}
        while pending - {status}:
            done, pending = await asyncio.wait(pending, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()

    async def _wait_for_bestview(self, bus: Bus) -> None:
        """Wait for the best-view service: frames published before it connects are lost, frame 0 included."""
        present = asyncio.Event()
        bus.watch_alive(self._keys.bestview("alive"), lambda _, alive: present.set() if alive else None)
        try:
            await asyncio.wait_for(present.wait(), self._config.sync.start_timeout_s)
        except TimeoutError:
            log.warning(
                "camera %s: no best-view service at %s yet",
                self._id,
                redact_zenoh_endpoint(self._config.zenoh.connect),
            )

    async def _follow_pulses(self) -> None:
        sync, fps = self._config.sync, self._config.site.fps
        # After a stall a recording catches up; a live camera continues with its newest picture.
        settings = ClientSettings(queue=2, free_run_after=sync.start_timeout_s)
        if self._pipeline.source.recorded:
            settings = replace(settings, queue=self._images_max, catch_up=self._config.track.backlog_s)
        client = PulseClient(
            sync.host,
            sync.port,
            self._id,
            fps_hint=fps,
            settings=settings,
            clock=self._clock,
            credentials=self._pulse_credentials,
            tls=self._pulse_tls,
        )
        async with client as pulses:
            self._meter.set_client(pulses)
            async for pulse in pulses:
                try:
                    await self._on_pulse(pulse, pulses.client_now() - pulse.due)
                except SourceEndedError:
                    log.info("camera %s: the recording has ended", self._id)
                    self._state, self._end = "ended", pulse.number
                    await self._backlog.put(None)
                    return

    async def _on_pulse(self, pulse: Pulse, late: float) -> None:
        due = asyncio.get_running_loop().time() - late
        await self._send_audio(pulse.number)
        if not self._load.captures(pulse.number):
            self._meter.count_missed(pulse.number, 1 + pulse.missed)
            self._queue_for_tracking(pulse.number, None, due, skipped=True)
            return
        image = await self._run_in(self._video, lambda: self._pipeline.take(pulse.number))
        if image is None:
            if self._pipeline.away:
                self._state = "away"
            self._meter.count_missed(pulse.number, 1 + pulse.missed)
            self._queue_for_tracking(pulse.number, None, due)
            return
        self._state = "live"
        captured_at = self._clock()
        unit = await self._run_in(self._video, lambda: self._pipeline.encode(pulse.number, image))
        head = FrameHeader(
            pulse=pulse.number,
            key=unit.key,
            boot=self._boot,
            reference_pulse=unit.reference_pulse,
            due=pulse.due,
            captured_at=captured_at,
            encoded=self._clock(),
        )
        self._publish("video", unit.data, msgspec.json.encode(head))
        self._meter.count_frame(pulse.number, pulse.missed)
        self._queue_for_tracking(pulse.number, image, due)

    async def _send_audio(self, pulse: int) -> None:
        """Publish the audio of this pulse, if this process has the site's audio source."""
        audio = self._audio
        if audio is None:
            return
        for run in consecutive_runs(await self._run_in(self._video, lambda: audio.take(pulse))):
            head = AudioHeader(first=run[0].number, sizes=[len(frame.data) for frame in run])
            if self._bus is not None:
                data = b"".join(frame.data for frame in run)
                self._bus.publish(self._keys.sound, data, msgspec.json.encode(head))

    def _queue_for_tracking(
        self, pulse: int, image: Image | None, due: float, *, skipped: bool = False
    ) -> None:
        """Queue a frame for the tracker, without its image where tracking is far behind."""
        shed = image is not None and self._backlog.qsize() >= self._images_max
        if shed:
            self._meter.count_skipped_detection()
        if not self._backlog.full():
            now = asyncio.get_running_loop().time()
            self._backlog.put_nowait(_QueuedFrame(pulse, None if shed else image, now, due, skipped))

    async def _track(self) -> None:
        """Detect and track, frame by frame, behind the video."""
        thumbnail_interval = max(1, round(self._config.site.fps))
        detection_times: list[float] = []
        while (item := await self._backlog.get()) is not None:
            pulse, image, skipped = item.pulse, item.image, item.skipped
            if image is not None and not self._load.detects(pulse):
                image, skipped = None, True
                self._meter.count_skipped_detection()
            began = time.perf_counter()
            detect = partial(self._pipeline.detect, pulse, image, skipped=skipped)
            frame = await self._run_in(self._tracking, detect)
            if image is not None:
                detection_times.append(time.perf_counter() - began)
            now = asyncio.get_running_loop().time()
            self._load.measure_lag(now - item.due, now)
            peers = await self._exchange.exchange(
                pulse, frame.message, item.captured, needed=frame.depends_on_peers
            )
            began = time.perf_counter()
            track = partial(self._pipeline.track_detections, frame, peers, self._corrections.take())
            tracks = await self._run_in(self._tracking, track)
            if tracks is None:
                continue
            detection_s, solve_s = (
                fmean(detection_times) if detection_times else None,
                time.perf_counter() - began,
            )
            detection_times.clear()
            self._send_tracks(msgspec.structs.replace(tracks, detection_s=detection_s, solve_s=solve_s))
            if image is not None and tracks.epoch * self._config.track.window.stride % thumbnail_interval < (
                self._config.track.window.stride
            ):
                await self._send_thumbnails(image, tracks)
        await self._exchange.publish_end(self._pipeline.end_message(self._end))
        self._send_tracks(await self._run_in(self._tracking, lambda: self._pipeline.finish(self._end)))

    def _send_tracks(self, tracks: CameraTracks) -> None:
        self._publish("tracks", msgspec.json.encode(msgspec.structs.replace(tracks, solved_at=self._clock())))

    async def _send_thumbnails(self, image: Image, tracks: CameraTracks) -> None:
        thumbnails = await self._run_in(self._tracking, lambda: encode_thumbnails(image, tracks))
        for track, jpeg in thumbnails.items():
            head = ThumbnailHeader(track=track, boot=self._boot, pulse=tracks.last)
            self._publish(f"thumbs/{track}", jpeg, msgspec.json.encode(head))

    async def _send_status_periodically(self) -> None:
        while True:
            self._send_status()
            await asyncio.sleep(_STATUS_EVERY_S)

    def _send_status(self) -> None:
        status: CameraStatus = self._meter.status(
            self._id, self._boot, self._state, self._backlog.qsize(), self._load
        )
        bad = self._exchange.bad_messages + self._corrections.bad_messages
        status = msgspec.structs.replace(
            status, position_corrections=self._corrections.count, bad_messages=bad
        )
        self._publish("status", msgspec.json.encode(status))

    def _publish(self, topic: str, payload: bytes, attachment: bytes | None = None) -> None:
        if self._bus is not None:
            self._bus.publish(self._keys.camera(self._id, topic), payload, attachment)

    @staticmethod
    async def _run_in(pool: ThreadPoolExecutor, work: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(pool, work)
