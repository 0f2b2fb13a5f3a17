"""A network that is opened on the best of onnxruntime's execution providers that works."""

from __future__ import annotations

import contextlib
import ctypes
import io
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tracking.detectors.neural.providers import (
    CPU,
    Provider,
    needs_cuda_libraries,
    provider_names,
    provider_options,
    short_name,
)
from tracking.detectors.neural.yolo_output import END_TO_END

Planes = npt.NDArray[np.floating]

_INPUTS: dict[str, type[np.floating]] = {"tensor(float)": np.float32, "tensor(float16)": np.float16}
_DIMENSIONS = 4
_NOISE_SEED = 1
_LEAST_DIFFERENCE, _DIFFERENT_SHARE = 0.05, 0.01
"""Difference from the processor's outputs that is none, and what is added to it: a share of the largest."""
_FATAL, _WARNING = 4, 2
"""Severities of onnxruntime's log."""


@dataclass(frozen=True, slots=True)
class NetworkSession:
    """An open network with one input: images `(1, 3, h, w)`.

    Attributes:
        size: height and width of the input, in pixels.
        element: type of the input's numbers.
        provider: what runs the network, as onnxruntime calls it without "ExecutionProvider".
        failures: preferred providers that could not be used, each with the reason, in one line.
    """

    _session: Any
    _input: str
    size: tuple[int, int]
    element: type[np.floating]
    provider: str
    failures: tuple[str, ...] = ()

    def run(self, planes: Planes) -> Planes:
        """Return the first output for an input.

        Raises:
            ValueError: the network cannot be run.
        """
        try:
            return np.asarray(self._session.run(None, {self._input: planes})[0])
        except Exception as error:  # onnxruntime has no common exception class
            raise ValueError(f"the network cannot be run: {_one_line(error)}") from error


def open_session(model: Path, provider: Provider, threads: int, input_size: int) -> NetworkSession:
    """Open an ONNX file on the first provider that loads, runs, and computes what the processor does.

    Args:
        model: the file.
        provider: the requested provider, or ``auto``.
        threads: threads of the network, where it runs on the processor.
        input_size: side of the input in pixels, if the file leaves it open.

    Raises:
        ValueError: it is not a network with an image input, or the provider is not installed.
        OSError: the file cannot be read.
        ImportError: onnxruntime is not installed, which is an optional dependency.
    """
    try:
        import onnxruntime  # noqa: PLC0415
    except ImportError as error:
        raise ImportError("onnxruntime is not installed: pip install 'myview[neural]'") from error
    content = model.read_bytes()
    names = provider_names(provider, onnxruntime.get_available_providers())
    try:
        session = _create(onnxruntime, content, CPU, threads)
    except Exception as error:  # onnxruntime has no common exception class
        raise ValueError(f"{model}: not a usable ONNX file: {_one_line(error)}") from error
    on_cpu = _describe(session, model, input_size)
    if needs_cuda_libraries(names) and hasattr(onnxruntime, "preload_dlls"):
        # Finds CUDA and cuDNN where pip installs them; it prints what it does not find.
        with contextlib.redirect_stdout(io.StringIO()):
            onnxruntime.preload_dlls()
    failures: list[str] = []
    for name in names[:-1]:
        try:
            opened = _describe(_create(onnxruntime, content, name, threads), model, input_size)
            fault = _fault(opened, short_name(name), on_cpu)
        except Exception as error:  # noqa: BLE001 — whatever it is, another provider is tried
            fault = _one_line(error)
        if not fault:
            return replace(opened, failures=tuple(failures))
        failures.append(f"{short_name(name)}: {_missing_library(onnxruntime, name) or fault}")
    return replace(on_cpu, failures=tuple(failures))


def _create(onnxruntime: Any, content: bytes, name: str, threads: int) -> Any:
    """Return a session on one provider, and on the CPU where that lacks an operation."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = _FATAL  # errors are raised instead of printed
    providers: list[Any] = [(name, provider_options(name, threads))]
    if name != CPU:
        providers.append(CPU)
    # Providers that fail to load print several lines, and are left out in silence otherwise.
    onnxruntime.set_default_logger_severity(_FATAL)
    try:
        return onnxruntime.InferenceSession(content, options, providers=providers, enable_fallback=0)
    finally:
        onnxruntime.set_default_logger_severity(_WARNING)


def _describe(session: Any, model: Path, input_size: int) -> NetworkSession:
    """Return a session with its input's name, size and type.

    Raises:
        ValueError: the input is not an image.
    """
    inputs = session.get_inputs()
    shape = list(inputs[0].shape)
    fits = len(inputs) == 1 and len(shape) == _DIMENSIONS and shape[0] in {1, None} | _names(shape[:1])
    if not (fits and shape[1] in {3, None} | _names(shape[1:2]) and inputs[0].type in _INPUTS):
        raise ValueError(f"{model}: the input is {inputs[0].type} {shape}, not floats (1, 3, height, width)")
    height, width = (side if isinstance(side, int) else input_size for side in shape[2:])
    provider = short_name(session.get_providers()[0])
    return NetworkSession(session, str(inputs[0].name), (height, width), _INPUTS[inputs[0].type], provider)


def _names(sides: list[Any]) -> set[Any]:
    """Return the dimensions that the file leaves open, which have a name instead of a number."""
    return {side for side in sides if isinstance(side, str)}


def _fault(opened: NetworkSession, provider: str, reference: NetworkSession) -> str:
    """Return why a session cannot be used on a provider; empty if it can.

    onnxruntime's providers have errors: CUDA resizes maps wrongly whose channels are last, and reads beyond
    their end.

    Raises:
        ValueError: it cannot be run.
    """
    if opened.provider != provider:
        return "cannot be loaded"
    noise = np.random.default_rng(_NOISE_SEED).random((1, 3, *opened.size)).astype(opened.element)
    found, expected = opened.run(noise), reference.run(noise)
    if found.shape != expected.shape:
        return "its results differ from the processor's"
    found, expected = found.astype(np.float64), expected.astype(np.float64)
    if expected.shape[-1] == END_TO_END:
        # Its rows are in the order of scores, of which some are nearly equal.
        found, expected = np.sort(found, axis=-2), np.sort(expected, axis=-2)
    largest = float(np.abs(expected).max(initial=0.0))
    is_close = np.abs(found - expected) <= _LEAST_DIFFERENCE + _DIFFERENT_SHARE * largest
    return "" if is_close.all() else "its results differ from the processor's"


def _missing_library(onnxruntime: Any, name: str) -> str:
    """Return why a provider's library cannot be loaded, which onnxruntime only logs; empty if it can."""
    folder = Path(onnxruntime.__file__).parent / "capi"
    for library in folder.glob(f"*onnxruntime_providers_{short_name(name).lower()}.*"):
        try:
            ctypes.CDLL(str(library))
        except OSError as error:
            return _one_line(error)
    return ""


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:200]
