"""Names of detectors: a kind, an installed network, or both as `fused+nanodet`."""

from __future__ import annotations

from typing import Any, get_args

from server.config.sections.detect import DetectorKind, DetectSettings
from server.models.catalog import MODELS, find_model
from server.models.installed import is_installed

NETWORK = "onnx"
"""The kind that is a network alone, which is named by its network."""
_ONE_OF_THE_OTHERS = "auto"
"""The kind that stands for another one, by what is installed."""

CHOICE = "auto"
"""The kind that is one of the others."""


def detector_names() -> list[str]:
    """Return all detectors: kinds without a network, installed networks, and kinds with each of these."""
    networks = [model.name for model in MODELS if is_installed(model)]
    kinds = [kind for kind in get_args(DetectorKind) if kind != _ONE_OF_THE_OTHERS]
    with_network = [kind for kind in kinds if _needs_network(kind)]
    return [
        *(kind for kind in kinds if kind not in with_network and kind != CHOICE),
        *networks,
        *(f"{kind}+{network}" for kind in with_network if kind != NETWORK for network in networks),
    ]


def detector_settings(name: str) -> dict[str, Any]:
    """Return the section `detect` for a name."""
    if find_model(name) is not None:
        return {"kind": NETWORK, "onnx": {"model": name}}
    kind, _, network = name.partition("+")
    return {"kind": kind, "onnx": {"model": network}} if network else {"kind": kind}


def _needs_network(kind: DetectorKind) -> bool:
    try:
        DetectSettings(kind=kind)
    except ValueError:
        return True
    return False
