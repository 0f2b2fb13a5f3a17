"""Speed of the installed networks by provider and batch size, and the cameras that a device serves.

    OMP_NUM_THREADS=1 python -m benchmarks.detectors.network_speed --out out/bench
    OMP_NUM_THREADS=1 python -m benchmarks.detectors.network_speed --processes 1 --processes 16

A *search* is the network for one picture and all that is done around it: scaling, decoding, suppression. Each
camera has its own process, which searches one picture in `--every`; *cameras* are those of one process that
does nothing else, with pictures one by one, and with the best batch. With `--processes`, that many processes
search at once, one picture each, as cameras do: their cameras are measured together. Differences are those of
the outputs from those of one processor thread: sides of boxes in pixels of the input, and scores.

Pictures are noise, on which these networks take the same time as on others; with recordings in `--data` they
are of `terrace`, so that the outputs that are compared have people.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure

from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.detectors.batched_network import batched_network
from benchmarks.detectors.timed_networks import (
    NetworkTimes,
    RunsOn,
    share_device,
    time_network,
    usable_providers,
)
from server.models.catalog import MODELS, InstallableModel
from server.models.installed import is_installed, network_path
from tracking.detectors import Image

BATCHES = (1, 2, 4, 8, 16, 32)
_IMAGES, _SIZE = 16, (640, 360)
_EVERY = 40
"""Frames from one picture of a recording to the next."""
_SHARED_S = 3.0


def images_of(data: Path) -> list[Image]:
    """Return pictures of a recording, scaled to 640x360; noise if there is none."""
    video = cv2.VideoCapture(str(data / "terrace" / "c0.mp4"))
    images = []
    for number in range(_IMAGES * _EVERY):
        found, image = video.read()
        if not found:
            break
        if number % _EVERY == 0:
            images.append(np.asarray(cv2.resize(image, _SIZE), dtype=np.uint8))
    noise = np.random.default_rng(1).integers(0, 256, (_IMAGES, _SIZE[1], _SIZE[0], 3), dtype=np.uint8)
    return images or list(noise)


def cameras(milliseconds: float, options: argparse.Namespace) -> float:
    """Return how many cameras a device serves that takes so long for a picture."""
    searches_per_s = float(options.fps / options.every)
    return 1e3 / milliseconds / searches_per_s


def measure(options: argparse.Namespace) -> None:
    """Measure all installed networks; print and save tables and plot.

    Raises:
        CannotRunError: no network or no onnxruntime is installed, or nothing runs.
    """
    models = [model for model in MODELS if is_installed(model)]
    if not models:
        raise CannotRunError("needs networks: myview models install " + " ".join(m.name for m in MODELS))
    try:
        import onnxruntime  # noqa: PLC0415 — an optional dependency
    except ImportError as problem:
        raise CannotRunError("needs onnxruntime: pip install 'myview[neural]'") from problem
    cv2.setNumThreads(1)
    report = Report()
    report.line(f"onnxruntime {onnxruntime.__version__}: {', '.join(onnxruntime.get_available_providers())}")
    images = images_of(options.data)
    devices = usable_providers(onnxruntime.get_available_providers())
    measured = {model.name: _measure_model(report, model, devices, images) for model in models}
    rows = [
        [name, runs_on.label, *_cells(times, options)]
        for name, by_device in measured.items()
        for runs_on, times in by_device.items()
    ]
    if not rows:
        raise CannotRunError("no network runs on anything here")
    report.table(
        f"Milliseconds a picture; cameras of {options.fps:g} pictures/s, one in {options.every} searched",
        [
            *("network", "runs on", *(f"batch {batch}" for batch in BATCHES)),
            *("search", "processor", "cameras", "of batches", "boxes", "scores"),
        ],
        rows,
    )
    if options.processes:
        _share(report, models, measured, images, options)
    plot(measured, options.out / "network_speed.png")
    report.save(options.out / "network_speed.txt")


def _measure_model(
    report: Report, model: InstallableModel, devices: list[RunsOn], images: list[Image]
) -> dict[RunsOn, NetworkTimes]:
    """Return the times of a network by what runs it; what cannot is reported and left out."""
    path = network_path(model)
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        batched = Path(folder) / path.name
        batched.write_bytes(batched_network(path.read_bytes()))
        for runs_on in devices:
            try:
                found[runs_on] = time_network(path, batched, runs_on, BATCHES, images)
            except ValueError as problem:
                report.line(f"{model.name}: {runs_on.label} is left out: {problem}")
    return found


def _cells(times: NetworkTimes, options: argparse.Namespace) -> list[str]:
    best = min(times.batches.values()) + max(times.search_ms - times.batches[1], 0.0)
    return [
        *(f"{milliseconds:.2f}" for milliseconds in times.batches.values()),
        f"{times.search_ms:.2f}",
        f"{times.processor_ms:.2f}",
        f"{cameras(times.search_ms, options):.0f}",
        f"{cameras(best, options):.0f}",
        f"{times.box_difference:.3f}",
        f"{times.score_difference:.5f}",
    ]


def _share(
    report: Report,
    models: list[InstallableModel],
    measured: dict[str, dict[RunsOn, NetworkTimes]],
    images: list[Image],
    options: argparse.Namespace,
) -> None:
    """Measure several processes on one device."""
    rows = []
    for model in models:
        for runs_on in measured[model.name]:
            if runs_on.threads > 1:
                continue
            for processes in options.processes:
                shared = share_device(network_path(model), runs_on, processes, images, _SHARED_S)
                memory = "" if shared.memory_mib is None else f"{shared.memory_mib:.0f}"
                speed = f"{shared.images_per_s:.0f}"
                served = f"{cameras(1e3 / shared.images_per_s, options):.0f}"
                cells = (str(processes), speed, f"{shared.processor_ms:.2f}", served, memory)
                rows.append([model.name, runs_on.label, *cells])
    report.table(
        "Processes that search at once, one picture each",
        ["network", "runs on", "processes", "pictures/s", "processor ms", "cameras", "GPU MiB"],
        rows,
    )


def plot(measured: dict[str, dict[RunsOn, NetworkTimes]], path: Path) -> None:
    """Draw the time of a picture over the batch size."""
    figure = Figure(figsize=(4.0 * len(measured), 3.6), layout="constrained")
    axes = figure.subplots(1, len(measured), squeeze=False, sharey=True)[0]
    for axis, (name, by_device) in zip(axes, measured.items(), strict=True):
        for runs_on, times in by_device.items():
            axis.loglog(list(times.batches), list(times.batches.values()), "o-", label=runs_on.label)
        axis.set_title(name)
        axis.set_xlabel("pictures at once")
        axis.set_xticks(BATCHES, [str(batch) for batch in BATCHES], minor=False)
        axis.legend()
    axes[0].set_ylabel("milliseconds a picture")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "detectors.network_speed")
    options.add_argument("--fps", type=float, default=25.0, help="pictures of a camera in a second")
    options.add_argument("--every", type=int, default=5, help="one picture in so many is searched")
    options.add_argument(
        "--processes", type=int, action="append", default=[], help="processes at once; may be repeated"
    )
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "detectors.network_speed")


if __name__ == "__main__":
    main()
