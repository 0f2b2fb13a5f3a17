"""The offline way: the same classes as live, with a clock that waits for everybody."""

from __future__ import annotations

import multiprocessing
import queue
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from multiprocessing.queues import Queue
from typing import TypeAlias

from server.camera.encode import AccessUnit
from server.camera.pipeline import CameraPipeline
from server.camera.sources import SourceEnded
from server.run.ending import end_at_once_again, end_with_parent, ending_later
from server.wire.config import Config
from server.wire.errors import UserError
from server.wire.messages import CameraTracks

_AHEAD = 8
"""Batches a camera may be ahead of the others: bounds memory however long the recording is."""
_POLL_S = 1.0


@dataclass(frozen=True, slots=True)
class Batch:
    """What one camera did up to the end of one epoch."""

    camera: str
    units: list[AccessUnit]
    tracks: CameraTracks | None
    ended: bool


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a camera's worker ended before its recording."""

    text: str
    bad_input: bool


Outbox: TypeAlias = "Queue[Batch | Failure]"


class CameraWorkers:
    """One process per camera; gives their batches in turn, so that all are at the same pulse.

    Raises:
        UserError: while iterating, when a camera's recording cannot be read.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._outboxes: dict[str, Outbox] = {}
        self._processes: dict[str, BaseProcess] = {}

    def start(self) -> None:
        """Start all workers; a signal waits until each is known, so that :meth:`close` ends every one."""
        context = multiprocessing.get_context("spawn")
        with ending_later():
            for camera in self._config.camera_ids:
                outbox: Outbox = context.Queue(_AHEAD)
                process = context.Process(
                    target=_work, args=(self._config, camera, outbox), name=camera, daemon=True
                )
                process.start()
                self._outboxes[camera], self._processes[camera] = outbox, process

    def __iter__(self) -> Iterator[Batch]:
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

    def _next(self, camera: str) -> Batch:
        while True:
            alive = self._processes[
                camera
            ].is_alive()  # before looking: its last word may still be on the way
            try:
                item = self._outboxes[camera].get(timeout=_POLL_S)
            except queue.Empty:
                if alive:
                    continue
                raise UserError(f"camera {camera}: its worker died") from None
            if isinstance(item, Failure):
                if item.bad_input:
                    raise UserError(item.text)
                raise RuntimeError(item.text)  # noqa: TRY004 — what failed was not an argument
            return item


def _work(config: Config, camera: str, outbox: Outbox) -> None:
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends its workers
    end_at_once_again()
    try:
        pipeline = CameraPipeline(config, camera)
        for batch in run_camera(pipeline, camera):
            outbox.put(batch)
    except UserError as error:
        outbox.put(Failure(str(error), bad_input=True))
    except Exception as error:  # noqa: BLE001 — goes to the parent, which raises it
        outbox.put(Failure(f"camera {camera}: {type(error).__name__}: {error}", bad_input=False))


def run_camera(pipeline: CameraPipeline, camera: str) -> Iterator[Batch]:
    """Run a recording through a camera's pipeline, epoch by epoch."""
    units: list[AccessUnit] = []
    pulse = 0
    while True:
        try:
            image = pipeline.take(pulse)
        except SourceEnded:
            break
        if image is not None:
            units.append(pipeline.encode(pulse, image))
        tracks = pipeline.track(pulse, image)
        if tracks is not None:
            yield Batch(camera, units, tracks, ended=False)
            units = []
        pulse += 1
    tracks = pipeline.finish(pulse)
    pipeline.close()
    if pulse <= max(0, pipeline.begins):
        raise UserError(f"camera {camera}: there is not one picture in its recording")
    yield Batch(camera, units, tracks, ended=True)
