"""onnxruntime's execution providers: what a network runs on, in which order, and with which options."""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal

Provider = Literal["auto", "cuda", "tensorrt", "openvino", "coreml", "cpu"]

CPU = "CPUExecutionProvider"
_CUDA, _TENSORRT = "CUDAExecutionProvider", "TensorrtExecutionProvider"
_OPENVINO = "OpenVINOExecutionProvider"
_NAMES: dict[Provider, str] = {
    "cuda": _CUDA,
    "tensorrt": _TENSORRT,
    "openvino": _OPENVINO,
    "coreml": "CoreMLExecutionProvider",
    "cpu": CPU,
}
_ORDER: dict[Provider, tuple[Provider, ...]] = {
    "auto": ("cuda", "openvino", "coreml"),
    # Compiles a network for minutes at first, so it has to be asked for. CUDA runs what it cannot.
    "tensorrt": ("tensorrt", "cuda"),
}


def provider_names(provider: Provider, available: Collection[str]) -> list[str]:
    """Return the names of the providers to try, best first; the CPU is always the last.

    Raises:
        ValueError: the requested provider is not installed.
    """
    if provider != "auto" and _NAMES[provider] not in available:
        raise ValueError(f"provider: this onnxruntime has no {provider}, only {', '.join(sorted(available))}")
    order = [_NAMES[one] for one in _ORDER.get(provider, (provider,))]
    return [*(name for name in order if name in available and name != CPU), CPU]


def provider_options(name: str, threads: int) -> dict[str, str]:
    """Return a provider's options: the precision of the CPU, the same choices every time, and few resources.

    Args:
        name: its name, as onnxruntime has it.
        threads: threads of the network.
    """
    if name == _CUDA:
        return {
            "use_tf32": "0",
            # By default each process times all algorithms, and may choose others than the process before.
            "cudnn_conv_algo_search": "HEURISTIC",
            # Each camera has its process, and all of them share the memory.
            "arena_extend_strategy": "kSameAsRequested",
        }
    if name == _OPENVINO:
        # Otherwise it takes all processors, and half precision where they have it.
        return {"num_of_threads": str(threads), "precision": "ACCURACY"}
    return {}


def needs_cuda_libraries(names: Collection[str]) -> bool:
    """Return whether one of the providers is linked with NVIDIA's libraries."""
    return bool({_CUDA, _TENSORRT} & set(names))


def short_name(name: str) -> str:
    """Return a provider's name without the part that is common to all."""
    return name.removesuffix("ExecutionProvider")
