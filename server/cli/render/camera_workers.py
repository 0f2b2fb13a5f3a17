"""Offline camera workers: the live pipeline in one process per camera, in lockstep instead of real time."""

from __future__ import annotations

import logging
import queue
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from multiprocessing.queues import Queue
from typing import TypeAlias

from server.camera.encoder import AccessUnit
from server.camera.peers.cross_view_scorer import PeerDetections
from server.camera.pipeline import CameraPipeline, DetectedFrame
from server.camera.sources import SourceEndedError
from server.cli.render.peer_pipes import PeerLink, PeerPipeFactory, PeerPipes
from server.config.site_config import Config
from server.messaging.messages import CameraTracks, FrameDetections
from server.system.child_process import SPAWN, defer_termination, start_function
from server.system.errors import UserError

log = logging.getLogger(__name__)

_QUEUE_BATCHES = 8
"""Batches by which a camera may be ahead of the others; limits memory for long recordings."""
_POLL_S = 1.0


@dataclass(frozen=True, slots=True)
class EpochBatch:
    """Access units and tracks of one camera up to the end of an epoch."""

    camera: str
    units: list[AccessUnit]
    tracks: CameraTracks | None
    ended: bool


@dataclass(frozen=True, slots=True)
class WorkerFailure:
    """Why a camera's worker ended before its recording."""

    text: str
    bad_input: bool


Outbox: TypeAlias = "Queue[EpochBatch | WorkerFailure]"


class CameraWorkers:
    """One process per camera; yields the batches of all cameras in turn, so that they stay at the same pulse.

    Raises:
        UserError: while iterating, when a camera's recording cannot be read.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._outboxes: dict[str, Outbox] = {}
        self._processes: dict[str, BaseProcess] = {}

    def start(self) -> None:
        """Start all workers; signals are deferred, so that :meth:`close` can end each worker."""
        pipe_factory = PeerPipeFactory(
            {camera: self._config.peers_of(camera) for camera in self._config.camera_ids}
        )
        with defer_termination():
            for camera in self._config.camera_ids:
                outbox: Outbox = SPAWN.Queue(_QUEUE_BATCHES)
                with pipe_factory.open_while_starting(camera) as pipes:
                    process = start_function(camera, _work, self._config, camera, outbox, pipes)
                self._outboxes[camera], self._processes[camera] = outbox, process

    def __iter__(self) -> Iterator[EpochBatch]:
        running = dict(self._outboxes)
        while running:
            for camera in list(running):
                batch = self._next(camera)
                yield batch
                if batch.ended:
                    del running[camera]

    def close(self) -> None:
        """End all workers."""
        for process in self._processes.values():
            process.terminate()
            process.join()

    def _next(self, camera: str) -> EpochBatch:
        while True:
            # Checked before the queue: a worker may exit after it has put its last batch.
            alive = self._processes[camera].is_alive()
            try:
                item = self._outboxes[camera].get(timeout=_POLL_S)
            except queue.Empty:
                if alive:
                    continue
                raise UserError(f"camera {camera}: its worker died") from None
            if isinstance(item, WorkerFailure):
                if item.bad_input:
                    raise UserError(item.text)
                raise RuntimeError(item.text)  # noqa: TRY004 — not a type error
            return item


def _work(config: Config, camera: str, outbox: Outbox, peers: PeerPipes) -> None:
    try:
        pipeline = CameraPipeline(config, camera)
        if pipeline.why_encoded:
            log.warning("camera %s is re-encoded: its own video: %s", camera, pipeline.why_encoded)
        for batch in run_camera(pipeline, camera, peers):
            outbox.put(batch)
    except UserError as error:
        outbox.put(WorkerFailure(str(error), bad_input=True))
    except Exception as error:  # noqa: BLE001 — the parent raises it
        outbox.put(WorkerFailure(f"camera {camera}: {type(error).__name__}: {error}", bad_input=False))


def run_camera(pipeline: CameraPipeline, camera: str, peers: PeerLink | None = None) -> Iterator[EpochBatch]:
    """Run a recording through a camera's pipeline, epoch by epoch, in step with the others."""
    run = CameraRun(pipeline, camera)
    while not run.ended:
        detections = run.detect_for_peers()
        batch = run.track(peers.exchange(detections) if peers is not None and detections is not None else ())
        if batch is not None:
            yield batch


def run_cameras(pipelines: Mapping[str, CameraPipeline]) -> Iterator[EpochBatch]:
    """Run all cameras' recordings in this process, in step."""
    runs = {camera: CameraRun(pipeline, camera) for camera, pipeline in pipelines.items()}
    while runs:
        detections = {camera: run.detect_for_peers() for camera, run in runs.items()}
        for camera, run in list(runs.items()):
            peer_detections = [
                found for peer, found in detections.items() if peer != camera and found is not None
            ]
            batch = run.track(peer_detections)
            if batch is not None:
                yield batch
            if run.ended:
                del runs[camera]


class CameraRun:
    """One camera's recording, frame by frame: detection, then tracking."""

    def __init__(self, pipeline: CameraPipeline, camera: str) -> None:
        self._pipeline, self._camera = pipeline, camera
        self._units: list[AccessUnit] = []
        self._pulse = 0
        self._frame: DetectedFrame | None = None
        self.ended = False

    def detect_for_peers(self) -> FrameDetections | None:
        """Take and encode the next frame and detect people; return the detections for the peers, if any."""
        try:
            frame = self._pipeline.take(self._pulse)
        except SourceEndedError:
            self._frame = None
            return self._pipeline.end_message(self._pulse)
        if frame is not None:
            self._units.append(self._pipeline.encode(self._pulse, frame))
        self._frame = self._pipeline.detect(self._pulse, frame)
        return self._frame.message

    def track(self, peer_detections: Sequence[FrameDetections]) -> EpochBatch | None:
        """Track people in the frame, with the peers' detections; return a batch at the end of an epoch.

        Raises:
            UserError: the recording is over and had no pictures.
        """
        if self._frame is None:
            return self._finish()
        tracks = self._pipeline.track_detections(self._frame, PeerDetections(tuple(peer_detections)))
        self._pulse += 1
        if tracks is None:
            return None
        units, self._units = self._units, []
        return EpochBatch(self._camera, units, tracks, ended=False)

    def _finish(self) -> EpochBatch:
        self.ended = True
        tracks = self._pipeline.finish(self._pulse)
        self._pipeline.close()
        if self._pulse <= max(0, self._pipeline.first_pulse):
            raise UserError(f"camera {self._camera}: its recording has no pictures")
        return EpochBatch(self._camera, self._units, tracks, ended=True)
