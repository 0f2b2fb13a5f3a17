"""onnxruntime's execution providers: what a network runs on."""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal

Provider = Literal["auto", "cuda", "tensorrt", "openvino", "coreml", "cpu"]

_NAMES: dict[Provider, str] = {
    "cuda": "CUDAExecutionProvider",
    "openvino": "OpenVINOExecutionProvider",
    "coreml": "CoreMLExecutionProvider",
    # Compiles a network for minutes at first, so it has to be asked for.
    "tensorrt": "TensorrtExecutionProvider",
    "cpu": "CPUExecutionProvider",
}
_PREFERRED: tuple[Provider, ...] = ("cuda", "openvino", "coreml")


def provider_names(provider: Provider, available: Collection[str]) -> list[str]:
    """Return the names of the providers to try, best first; the CPU is always the last.

    Raises:
        ValueError: the requested provider is not installed.
    """
    if provider == "auto":
        names = [_NAMES[one] for one in _PREFERRED if _NAMES[one] in available]
    elif _NAMES[provider] in available:
        names = [_NAMES[provider]]
    else:
        raise ValueError(f"provider: this onnxruntime has no {provider}, only {', '.join(sorted(available))}")
    return [*(name for name in names if name != _NAMES["cpu"]), _NAMES["cpu"]]
