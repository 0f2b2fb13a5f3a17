"""Builds an ONNX graph node by node."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

_IR_VERSION = 9
"""The newest that onnxruntime 1.20 reads."""


class OnnxBuilder:
    """A graph under construction; values are known by name.

    The package `onnx` is imported where it is needed: it is an optional dependency.
    """

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        """The nodes so far, each after those that it depends on."""
        self.initializers: list[Any] = []
        """The constants so far."""
        self._count = 0

    def constant(self, value: Array) -> str:
        """Add a constant; return its name."""
        from onnx import numpy_helper  # noqa: PLC0415

        name = self._new_name()
        self.initializers.append(numpy_helper.from_array(np.ascontiguousarray(value), name))
        return name

    def add(self, operation: str, inputs: Sequence[str], output: str | None = None, **attributes: Any) -> str:
        """Add a node with one output; return the output's name, which is made up by default."""
        from onnx import helper  # noqa: PLC0415

        output = output or self._new_name()
        self.nodes.append(helper.make_node(operation, list(inputs), [output], **attributes))
        return output

    def scale(self, value: str, factor: float | Array, output: str | None = None) -> str:
        """Multiply by a constant, which is broadcast."""
        return self.add("Mul", [value, self.constant(np.asarray(factor, dtype=np.float32))], output)

    def reshape(self, value: str, shape: Sequence[int]) -> str:
        """Reshape; one side may be -1, the rest."""
        return self.add("Reshape", [value, self.constant(np.array(shape, dtype=np.int64))])

    def columns(self, value: str, first: int, end: int, axis: int = 2) -> str:
        """Return the entries from ``first`` to before ``end`` along an axis."""
        bounds = [self.constant(np.array([bound], dtype=np.int64)) for bound in (first, end, axis)]
        return self.add("Slice", [value, *bounds])

    def write(
        self, network_input: tuple[str, Sequence[int]], output: tuple[str, Sequence[int | None]], opset: int
    ) -> bytes:
        """Return the ONNX file of the graph with this input and output, by name and shape.

        Raises:
            ValueError: the graph is not valid.
        """
        from onnx import TensorProto, checker, helper  # noqa: PLC0415

        graph = helper.make_graph(
            self.nodes,
            "network",
            [helper.make_tensor_value_info(network_input[0], TensorProto.FLOAT, list(network_input[1]))],
            [helper.make_tensor_value_info(output[0], TensorProto.FLOAT, list(output[1]))],
            self.initializers,
        )
        network: Any = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)])
        network.ir_version = _IR_VERSION
        try:
            checker.check_model(network)
        except checker.ValidationError as error:
            raise ValueError(f"the network is not valid: {error}") from error
        return bytes(network.SerializeToString())

    def _new_name(self) -> str:
        self._count += 1
        return f"value_{self._count}"
