"""The provider that runs a network: the best that loads and runs, and each that does not said in one line."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fakes.tracking.tiny_networks import save_network, yolov8
from tracking.detectors import OnnxDetector, OnnxSettings
from tracking.detectors.neural.providers import provider_names

onnxruntime = pytest.importorskip("onnxruntime", reason="needs onnxruntime: pip install 'myview[neural]'")

CPU, CUDA = "CPUExecutionProvider", "CUDAExecutionProvider"
TENSORRT, OPENVINO = "TensorrtExecutionProvider", "OpenVINOExecutionProvider"
WHITE = np.full((128, 192, 3), 255, dtype=np.uint8)


class Runtime:
    """Stands in for the module onnxruntime; its networks run on the CPU, whatever provider they say."""

    __file__ = __file__

    def __init__(self, faults: dict[str, str]) -> None:
        self.faults = faults
        self.options: dict[str, dict[str, str]] = {}
        self.SessionOptions = onnxruntime.SessionOptions
        self.set_default_logger_severity = onnxruntime.set_default_logger_severity

    def get_available_providers(self) -> list[str]:
        return [*self.faults, CPU]

    def InferenceSession(self, content: bytes, options: Any, providers: list[Any], **_: Any) -> Any:  # noqa: N802
        (name, given), *_others = providers
        self.options[name] = given
        fault = self.faults.get(name, "")
        if fault == "raises":
            raise RuntimeError("CUDA failure 100: no CUDA-capable device is detected\nat line 1")
        session = onnxruntime.InferenceSession(content, options, providers=[CPU])

        def run(*arguments: Any) -> Any:
            if fault == "cannot run":
                raise RuntimeError("cuDNN is missing")
            found = session.run(*arguments)
            return [60.0 + values for values in found] if fault == "wrong" else found

        used = [CPU] if fault == "cannot load" else list(dict.fromkeys([name, CPU]))
        return SimpleNamespace(run=run, get_inputs=session.get_inputs, get_providers=lambda: used)


def opened(
    folder: Path, monkeypatch: pytest.MonkeyPatch, faults: dict[str, str], **settings: Any
) -> tuple[OnnxDetector, Runtime]:
    """Open a network with providers that have faults."""
    path = save_network(folder / "tiny.onnx", yolov8([(30.0, 32.0, 12.0, 40.0, 0.72)]))
    runtime = Runtime(faults)
    monkeypatch.setitem(sys.modules, "onnxruntime", runtime)
    return OnnxDetector(OnnxSettings(model=path, **settings)), runtime


def test_the_best_installed_provider_is_tried_first_and_the_cpu_last() -> None:
    assert provider_names("auto", ["AzureExecutionProvider", CPU]) == [CPU]
    assert provider_names("auto", [OPENVINO, TENSORRT, CUDA, CPU]) == [CUDA, OPENVINO, CPU]
    assert provider_names("tensorrt", [TENSORRT, CUDA, CPU]) == [TENSORRT, CUDA, CPU]
    assert provider_names("cpu", [CUDA, CPU]) == [CPU]
    with pytest.raises(ValueError, match="provider: this onnxruntime has no cuda, only CPUExecutionProvider"):
        provider_names("cuda", [CPU])


def test_a_provider_that_works_runs_the_network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    detector, runtime = opened(tmp_path, monkeypatch, {CUDA: "", OPENVINO: ""})
    assert (detector.provider, detector.failed_providers) == ("CUDA", ())
    assert OPENVINO not in runtime.options


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("cannot load", "cannot be loaded"),
        ("raises", "CUDA failure 100: no CUDA-capable device is detected at line 1"),
        ("cannot run", "the network cannot be run: cuDNN is missing"),
        ("wrong", "its results differ from the processor's"),
    ],
)
def test_a_provider_that_fails_is_named_with_the_reason_and_the_next_one_detects(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    fault: str,
    reason: str,
) -> None:
    detector, _ = opened(tmp_path, monkeypatch, {CUDA: fault, OPENVINO: ""})
    assert (detector.provider, detector.failed_providers) == ("OpenVINO", (f"CUDA: {reason}",))
    detector, _ = opened(tmp_path, monkeypatch, {CUDA: fault, OPENVINO: "cannot load"}, provider="cuda")
    assert (detector.provider, detector.failed_providers) == ("CPU", (f"CUDA: {reason}",))
    np.testing.assert_allclose(detector.detect(WHITE).scores, [0.72], rtol=1e-5)
    assert capfd.readouterr() == ("", "")


def test_openvino_uses_no_more_threads_than_configured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, runtime = opened(tmp_path, monkeypatch, {OPENVINO: ""}, threads=3)
    assert runtime.options[OPENVINO]["num_of_threads"] == "3"


def test_a_library_that_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "capi").mkdir()
    (tmp_path / "capi" / "libonnxruntime_providers_cuda.so").write_bytes(b"no library")
    monkeypatch.setattr(Runtime, "__file__", str(tmp_path / "__init__.py"))
    detector, _ = opened(tmp_path, monkeypatch, {CUDA: "cannot load"})
    (failure,) = detector.failed_providers
    assert failure.startswith("CUDA: ")
    assert "libonnxruntime_providers_cuda.so" in failure
