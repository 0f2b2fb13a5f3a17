"""One camera's process: on every pulse it captures a frame, encodes, publishes and tracks it."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from statistics import fmean
from typing import TypeVar

import msgspec

from camsync import ClientSettings, Pulse, PulseClient, steady_unix_clock
from logthrottle import LogThrottle
from server.camera.audio import LiveAudioSource, open_site_audio
from server.camera.end_confirmation import EndConfirmation
from server.camera.load.load_monitor import LoadMonitor
from server.camera.operator_corrections import CorrectionInbox
from server.camera.peers.detection_exchange import PeerDetectionExchange
from server.camera.picture_reports import ConditionLog, KnockLog
from server.camera.pipeline import CameraPipeline
from server.camera.publisher import CameraPublisher
from server.camera.retained_identity_snapshot import RetainedIdentitySnapshot
from server.camera.sources import Image, SourceEndedError
from server.camera.status_meter import StatusMeter
from server.camera.thumbnails import encode_thumbnails
from server.camera.tracking_backlog import TrackingBacklog
from server.config.pulse_access import pulse_client_tls, pulse_credentials
from server.config.site_config import Config
from server.messaging.bus import Bus, redact_endpoints
from server.messaging.camera_status import CameraState
from server.messaging.messages import CameraTracks, ZenohKeys

log = logging.getLogger(__name__)

T = TypeVar("T")

_STATUS_EVERY_S = 1.0
_END_CONFIRMED_WITHIN_S = 10.0
_WAITED_S = 0.01
"""Seconds of waiting for the substream from which tracking counts as not behind."""
_FURTHER_SERVICES_S = 2.0
"""How long to wait for the other best-view services once the first is there."""


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
        self._publisher = CameraPublisher(self._keys, camera_id, self._boot, self._clock)
        self._audio = open_site_audio(config, camera_id)
        listener = self._audio if isinstance(self._audio, LiveAudioSource) else None
        self._pipeline = CameraPipeline(config, camera_id, self._boot, listener)
        if self._pipeline.is_passthrough:
            log.info("camera %s: its own video is passed through", camera_id)
        elif self._pipeline.why_encoded:
            log.warning("camera %s is re-encoded: its own video: %s", camera_id, self._pipeline.why_encoded)
        self._video = ThreadPoolExecutor(1, "video")
        self._tracking = ThreadPoolExecutor(1, "tracking")
        fps = config.site.fps
        self._images_max = max(1, round(config.track.backlog_s * fps))
        self._backlog = TrackingBacklog(self._images_max, config.track.backlog_s)
        self._limit_log = LogThrottle()
        # Passthrough frames depend on each other, and recordings are shown completely: neither drops frames.
        live = not (self._pipeline.source.recorded or self._pipeline.is_passthrough)
        self._load = LoadMonitor(config, camera_id, live=live, has_network=self._pipeline.has_network)
        self._exchange = PeerDetectionExchange(
            config, camera_id, self._pipeline.cross_view, self._backlog.frames_max
        )
        self._corrections = CorrectionInbox(camera_id, self._boot)
        self._meter = StatusMeter(fps)
        self._state: CameraState = "starting"
        self._conditions = ConditionLog(camera_id)
        self._moved_since = 0.0
        self._knocks = KnockLog(camera_id)
        self._end = 0
        """The first pulse after the recording, once that has ended."""

    async def run(self) -> None:
        """Run until the recording ends; a live camera never does."""
        bus = Bus.client(self._config.zenoh, self._id)
        self._publisher.connect(bus)
        try:
            if self._config.track.assist.enabled:
                bus.subscribe(self._keys.camera(self._id, "position_corrections"), self._corrections.put)
            end = EndConfirmation(self._id, self._boot)
            end.listen(bus, self._keys)
            retained = RetainedIdentitySnapshot(self._publisher.publish_retained_identities)
            bus.subscribe(self._keys.camera(self._id, "identities"), retained.replace)
            bus.watch_alive(self._keys.bestview("**"), lambda _, is_present: retained.on_service(is_present))
            await self._wait_for_bestview(bus)
            bus.declare_alive(self._keys.camera(self._id, "alive"))
            await self._exchange.join()
            video = asyncio.create_task(self._follow_pulses(), name="pulses")
            tracking = asyncio.create_task(self._track(), name="track")
            status = asyncio.create_task(self._publish_status_periodically(), name="status")
            tasks = (video, tracking, status)
            try:
                await self._wait_until_done(video, tracking, status)
                self._publish_status()
                if not await end.wait(_END_CONFIRMED_WITHIN_S):
                    log.warning("camera %s: a best-view service did not confirm the last tracks", self._id)
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
        """Wait for the best-view services: frames published before one connects are lost, frame 0 included.

        Once one is there, the others are not waited for long: they may be down.
        """
        services = self._config.view.sharding.services
        present, first, every = set[str](), asyncio.Event(), asyncio.Event()

        def on_service(key: str, is_present: bool) -> None:
            (present.add if is_present else present.discard)(key)
            if present:
                first.set()
            if len(present) >= services:
                every.set()

        bus.watch_alive(self._keys.bestview("**"), on_service)
        try:
            await asyncio.wait_for(first.wait(), self._config.sync.start_timeout_s)
        except TimeoutError:
            text = "camera %s: no best-view service at %s yet"
            log.warning(text, self._id, redact_endpoints(self._config.zenoh))
            return
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(every.wait(), _FURTHER_SERVICES_S)

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
                    await self._backlog.end()
                    return

    async def _on_pulse(self, pulse: Pulse, late: float) -> None:
        due = asyncio.get_running_loop().time() - late
        await self._publish_audio(pulse.number)
        if not self._load.captures(pulse.number):
            self._meter.count_missed(pulse.number, 1 + pulse.missed)
            self._backlog.put(pulse.number, None, due, skipped=True)
            return
        frame = await self._run_in(self._video, lambda: self._pipeline.take(pulse.number))
        if frame is None:
            if self._pipeline.away:
                self._state = "away"
            self._meter.count_missed(pulse.number, 1 + pulse.missed)
            self._backlog.put(pulse.number, None, due)
            return
        self._state = "live"
        captured_at = self._clock()
        unit = await self._run_in(self._video, lambda: self._pipeline.encode(pulse.number, frame))
        self._publisher.publish_frame(pulse, unit, captured_at)
        self._meter.count_frame(pulse.number, pulse.missed)
        if self._backlog.put(pulse.number, frame, due):
            self._meter.count_skipped_detection()

    async def _publish_audio(self, pulse: int) -> None:
        """Publish the audio of this pulse, if this process has the site's audio source."""
        audio = self._audio
        if audio is not None:
            self._publisher.publish_audio(await self._run_in(self._video, lambda: audio.take(pulse)))

    async def _track(self) -> None:
        """Detect and track, frame by frame, behind the video."""
        stride, thumbnail_interval = self._config.window.stride, max(1, round(self._config.site.fps))
        detection_times: list[float] = []
        while (item := await self._backlog.get()) is not None:
            pulse, captured, skipped = item.pulse, item.frame, item.skipped
            if captured is not None and (self._backlog.is_outdated(item) or not self._load.detects(pulse)):
                captured, skipped = None, True
                self._meter.count_skipped_detection()
            began = time.perf_counter()
            factor = self._load.network_factor
            detect = partial(self._pipeline.detect, pulse, captured, skipped=skipped, network_factor=factor)
            frame = await self._run_in(self._tracking, detect)
            seconds = time.perf_counter() - began - frame.waited_s
            if frame.image is not None:
                detection_times.append(seconds)
            now = asyncio.get_running_loop().time()
            # A substream that is later than the video is no load.
            lag = seconds if frame.waited_s > _WAITED_S else now - item.due
            self._load.measure_lag(lag, now)
            peers = await self._exchange.exchange(
                pulse, frame.message, item.captured, needed=frame.depends_on_peers
            )
            began = time.perf_counter()
            track = partial(self._pipeline.track_detections, frame, peers, self._corrections.take())
            tracks = await self._run_in(self._tracking, track)
            if tracks is None:
                continue
            solve_s = time.perf_counter() - began
            self._report_limit(tracks)
            detection_s = fmean(detection_times) if detection_times else None
            detection_times.clear()
            self._publisher.publish_tracks(
                msgspec.structs.replace(tracks, detection_s=detection_s, solve_s=solve_s)
            )
            if frame.image is not None and tracks.epoch * stride % thumbnail_interval < stride:
                await self._publish_thumbnails(frame.image, tracks)
        await self._exchange.publish_end(self._pipeline.end_message(self._end))
        tracks = await self._run_in(self._tracking, lambda: self._pipeline.finish(self._end))
        self._publisher.publish_tracks(tracks)

    def _report_limit(self, tracks: CameraTracks) -> None:
        """Log windows that the clock has ended, after which tracks depend on the machine."""
        if tracks.solve is not None and tracks.solve.limit == "time":
            if (more := self._limit_log.record()) is not None:
                text = "camera %s: the solver was stopped after track.solver_time_s; gap %.2g%s"
                log.warning(text, self._id, tracks.solve.gap, more)
        elif ended := self._limit_log.end():
            log.info("camera %s: %d windows were stopped after track.solver_time_s", self._id, ended.count)

    async def _publish_thumbnails(self, image: Image, tracks: CameraTracks) -> None:
        scale = self._pipeline.tracked.scale
        thumbnails = await self._run_in(self._tracking, lambda: encode_thumbnails(image, tracks, scale))
        self._publisher.publish_thumbnails(thumbnails, tracks.last)

    async def _publish_status_periodically(self) -> None:
        while True:
            self._publish_status()
            await asyncio.sleep(_STATUS_EVERY_S)

    def _publish_status(self) -> None:
        view, motion = self._pipeline.view, self._pipeline.view.motion
        condition, covered_share = view.condition, view.covered_share
        lasts_s = (self._meter.pulse - view.since) / self._config.site.fps
        self._conditions.update(condition, covered_share, self._clock() - lasts_s)
        if self._knocks.update(motion):
            self._moved_since = self._clock()
        status = self._meter.status(self._id, self._boot, self._state, len(self._backlog), self._load)
        absence = self._pipeline.absence
        self._publisher.publish_status(
            msgspec.structs.replace(
                status,
                unavailable=absence.message() if absence else None,
                condition=condition,
                condition_since=self._conditions.since,
                covered_share=covered_share,
                substream=self._pipeline.tracked.state,
                motion=motion,
                motion_since=0.0 if motion is None else self._moved_since,
                position_corrections=self._corrections.count,
                bad_messages=self._exchange.bad_messages + self._corrections.bad_messages,
            )
        )

    @staticmethod
    async def _run_in(pool: ThreadPoolExecutor, work: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(pool, work)
