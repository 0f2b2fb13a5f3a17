"""Reads TensorFlow.js graph models: a JSON with the nodes, and a binary file with the weights."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from server.models.onnx_builder import Array


@dataclass(frozen=True, slots=True)
class GraphNode:
    """A node of a graph model.

    Attributes:
        name: its name, by which other nodes name its first output.
        operation: TensorFlow's name of the operation.
        inputs: names of outputs; `a:1` is the second output of `a`.
        attributes: attributes as in the JSON.
    """

    name: str
    operation: str
    inputs: tuple[str, ...]
    attributes: Mapping[str, Any]

    def integers(self, key: str) -> list[int]:
        """Return a list of integers."""
        return [int(value) for value in self.attributes[key]["list"].get("i", ())]

    def text(self, key: str) -> str:
        """Return a text."""
        return base64.b64decode(self.attributes[key]["s"]).decode()

    def texts(self, key: str) -> list[str]:
        """Return a list of texts."""
        return [base64.b64decode(value).decode() for value in self.attributes[key]["list"].get("s", ())]

    def is_set(self, key: str) -> bool:
        """Return a flag, false if it is missing."""
        return bool(self.attributes.get(key, {}).get("b", False))


@dataclass(frozen=True, slots=True, eq=False)
class GraphModel:
    """A graph model: its nodes by name, and its weights by the name of their constant."""

    nodes: Mapping[str, GraphNode]
    weights: Mapping[str, Array]


def read_graph_model(topology: bytes, weights: bytes) -> GraphModel:
    """Parse the two files of a graph model.

    Raises:
        ValueError: they are not a graph model, or the binary file has another length than the JSON states.
    """
    try:
        document = json.loads(topology)
        nodes = {
            node["name"]: GraphNode(
                node["name"], node["op"], tuple(node.get("input", ())), node.get("attr", {})
            )
            for node in document["modelTopology"]["node"]
        }
        entries = [entry for group in document["weightsManifest"] for entry in group["weights"]]
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"not a TensorFlow.js graph model: {error!r}") from error
    return GraphModel(nodes, _split_weights(entries, weights))


def _split_weights(entries: Iterable[Mapping[str, Any]], content: bytes) -> dict[str, Array]:
    weights, position = {}, 0
    for entry in entries:
        stored = np.dtype(entry.get("quantization", entry)["dtype"])
        count = int(np.prod(entry["shape"], dtype=np.int64))
        if position + count * stored.itemsize > len(content):
            raise ValueError(f"the weights end before {entry['name']}")
        values = np.frombuffer(content, stored, count, position).reshape(entry["shape"])
        weights[str(entry["name"])] = values.astype(np.dtype(entry["dtype"]))
        position += values.nbytes
    if position != len(content):
        raise ValueError(f"{len(content) - position} bytes follow the last weight")
    return weights
