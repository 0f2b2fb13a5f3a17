"""Time of a network by provider and batch size, in one process and in several at once."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import statistics
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.synchronize import Barrier
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracking.detectors import Image, OnnxDetector, OnnxSettings
from tracking.detectors.neural.providers import Provider
from tracking.detectors.neural.session import open_session

Floats = NDArray[np.floating]
_MIN_RUNS, _WARM_UP_RUNS = 3, 2
_STARTED_WITHIN_S = 240.0
_SEEN = 0.05
"""Probability from which boxes are compared."""


@dataclass(frozen=True, slots=True)
class RunsOn:
    """What runs a network.

    Attributes:
        provider: onnxruntime's execution provider.
        threads: threads of the network, if the processor runs it.
    """

    provider: Provider
    threads: int

    @property
    def label(self) -> str:
        """What the tables call it."""
        return (
            f"cpu, {self.threads} threads" if self.provider == "cpu" and self.threads > 1 else self.provider
        )


@dataclass(frozen=True, slots=True)
class NetworkTimes:
    """Times of a network, in milliseconds an image.

    Attributes:
        batches: median times of the network alone, by batch size.
        search_ms: median time of a search: the network for one image, and all that is done around it.
        processor_ms: processor time of a search.
        box_difference: largest difference of a side from the reference's, in pixels of the input.
        score_difference: largest difference of a score from the reference's.
    """

    batches: dict[int, float]
    search_ms: float
    processor_ms: float
    box_difference: float
    score_difference: float


def settings_of(model: Path, runs_on: RunsOn) -> OnnxSettings:
    """Return the settings of a detector."""
    return OnnxSettings(model=model, provider=runs_on.provider, threads=runs_on.threads, min_score=_SEEN)


def time_network(
    model: Path,
    batched: Path,
    runs_on: RunsOn,
    batches: Sequence[int],
    images: Sequence[Image],
    measured_s: float = 1.0,
) -> NetworkTimes:
    """Measure a network on one provider.

    Args:
        model: the file of the network.
        batched: the same network for several images at once.
        runs_on: the provider.
        batches: batch sizes.
        images: images that are searched one after the other.
        measured_s: least duration of each measurement.

    Raises:
        ValueError: the provider cannot be used; the text says why.
    """
    detector = OnnxDetector(settings_of(model, runs_on))
    if detector.failed_providers:
        raise ValueError("; ".join(detector.failed_providers))
    search_ms, processor_ms = _median_ms(lambda index: detector.find(images[index % len(images)]), measured_s)
    session = open_session(batched, runs_on.provider, runs_on.threads, 0)
    reference = open_session(model, "cpu", 1, 0)
    planes = _as_planes(images, session.size, max(batches))
    times = {}
    for batch in batches:
        part = planes[:batch]
        milliseconds, _ = _median_ms(lambda _, part=part: session.run(part), measured_s)  # type: ignore[misc]
        times[batch] = milliseconds / batch
    expected = np.concatenate([reference.run(planes[index : index + 1]) for index in range(len(planes))])
    return NetworkTimes(times, search_ms, processor_ms, *_differences(expected, session.run(planes)))


def _differences(expected: Floats, found: Floats) -> tuple[float, float]:
    """Return the largest differences of a side and a score between outputs `(N, 5, M)`."""
    seen = expected[:, 4] >= _SEEN
    boxes = np.abs(expected[:, :4] - found[:, :4]).max(axis=1)[seen]
    return float(boxes.max(initial=0.0)), float(np.abs(expected[:, 4] - found[:, 4]).max())


def _as_planes(images: Sequence[Image], size: tuple[int, int], count: int) -> NDArray[np.float32]:
    """Return `(count, 3, h, w)`, 0 to 1: the images, again and again, each cut to the size or repeated."""
    parts = [
        np.resize(images[index % len(images)][: size[0], : size[1], ::-1], (*size, 3))
        for index in range(count)
    ]
    return np.stack(parts).transpose(0, 3, 1, 2).astype(np.float32) / np.float32(255.0)


def _median_ms(run: Callable[[int], object], measured_s: float) -> tuple[float, float]:
    """Return the median time of a run, and the mean processor time of all threads."""
    for index in range(_WARM_UP_RUNS):
        run(index)
    seconds: list[float] = []
    processor = time.process_time()
    while len(seconds) < _MIN_RUNS or sum(seconds) < measured_s:
        began = time.perf_counter()
        run(len(seconds))
        seconds.append(time.perf_counter() - began)
    used = time.process_time() - processor
    return 1e3 * statistics.median(seconds), 1e3 * used / len(seconds)


@dataclass(frozen=True, slots=True)
class SharedDevice:
    """Several processes that search images on one device at once.

    Attributes:
        images_per_s: images that all of them together search in a second.
        processor_ms: processor time of a search, in the mean.
        memory_mib: memory of the GPU that is used meanwhile; None: unknown.
    """

    images_per_s: float
    processor_ms: float
    memory_mib: float | None


def share_device(
    model: Path, runs_on: RunsOn, processes: int, images: Sequence[Image], seconds: float
) -> SharedDevice:
    """Search images one by one in several processes at once, each with the network open.

    Raises:
        RuntimeError: a process has failed.
    """
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(processes + 1)
    results = context.Queue()
    arguments = (model, runs_on, list(images), seconds, barrier, results)
    workers = [context.Process(target=_search, args=arguments) for _ in range(processes)]
    for worker in workers:
        worker.start()
    try:
        barrier.wait(_STARTED_WITHIN_S)
        time.sleep(seconds / 2.0)
        memory = _gpu_memory()
        counts = [results.get(timeout=_STARTED_WITHIN_S) for _ in workers]
    except Exception as error:
        for worker in workers:
            worker.kill()
        raise RuntimeError(f"{processes} processes cannot run {model.name} on {runs_on.label}") from error
    for worker in workers:
        worker.join()
    searched = sum(count for count, _ in counts)
    processor_s = sum(used for _, used in counts)
    return SharedDevice(searched / seconds, 1e3 * processor_s / searched, memory)


def _search(
    model: Path,
    runs_on: RunsOn,
    images: list[Image],
    seconds: float,
    barrier: Barrier,
    results: multiprocessing.Queue[tuple[int, float]],
) -> None:
    detector = OnnxDetector(settings_of(model, runs_on))
    for image in images:
        detector.find(image)
    barrier.wait(_STARTED_WITHIN_S)
    count, processor = 0, time.process_time()
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        detector.find(images[count % len(images)])
        count += 1
    results.put((count, time.process_time() - processor))


def _gpu_memory() -> float | None:
    """Return the used memory of the first NVIDIA GPU in MiB."""
    command = shutil.which("nvidia-smi")
    if command is None:
        return None
    query = [command, "--query-gpu=memory.used", "--format=csv,noheader,nounits"]
    answer = subprocess.run(query, capture_output=True, text=True, check=False).stdout.split()
    return float(answer[0]) if answer and answer[0].isdigit() else None


def usable_providers(available: Sequence[str]) -> list[RunsOn]:
    """Return what can run networks here: a thread of the processor, all of them, and what is installed."""
    others: tuple[Provider, ...] = ("openvino", "coreml", "cuda", "tensorrt")
    installed = {name.removesuffix("ExecutionProvider").lower() for name in available}
    processors = os.cpu_count() or 1
    return [
        RunsOn("cpu", 1),
        *([RunsOn("cpu", processors)] if processors > 1 else []),
        *(RunsOn(provider, 1) for provider in others if provider in installed),
    ]
