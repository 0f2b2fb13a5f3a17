"""The benchmark of networks: several images at once give what each gives alone."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pytest

from fakes.models.graph_models import GraphModelFile, centernet_model, nanodet_model
from server.models.graph_model import read_graph_model
from server.models.person_networks import centernet_network, nanodet_network

onnxruntime = pytest.importorskip("onnxruntime", reason="needs onnxruntime: pip install 'myview[neural]'")
pytest.importorskip("onnx", reason="needs onnx: pip install 'myview[neural]'")

from benchmarks.detectors.batched_network import batched_network  # noqa: E402 — after the skips
from benchmarks.detectors.network_speed import cameras, images_of  # noqa: E402
from benchmarks.detectors.timed_networks import RunsOn, time_network, usable_providers  # noqa: E402

SIZE = (32, 64)


@pytest.mark.parametrize(
    ("model", "convert"), [(nanodet_model(), nanodet_network), (centernet_model(), centernet_network)]
)
def test_a_batch_gives_what_its_images_give_one_by_one(
    tmp_path: Path, model: GraphModelFile, convert: type
) -> None:
    content = convert(read_graph_model(model.topology(), model.binary()), SIZE)
    images = np.random.default_rng(3).random((3, 3, *SIZE), dtype=np.float32)
    alone = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    together = onnxruntime.InferenceSession(batched_network(content), providers=["CPUExecutionProvider"])
    expected = np.concatenate([alone.run(None, {"images": image[None]})[0] for image in images])
    np.testing.assert_allclose(together.run(None, {"images": images})[0], expected, atol=1e-4)
    path, batched = tmp_path / "one.onnx", tmp_path / "many.onnx"
    path.write_bytes(content)
    batched.write_bytes(batched_network(content))
    noise = images_of(tmp_path)[:2]
    times = time_network(path, batched, RunsOn("cpu", 1), (1, 3), noise, measured_s=0.0)
    assert list(times.batches) == [1, 3]
    assert (times.box_difference, times.score_difference) == pytest.approx((0.0, 0.0), abs=1e-3)


def test_cameras_are_those_whose_searched_pictures_are_done_in_time() -> None:
    options = argparse.Namespace(fps=25.0, every=5)
    assert cameras(10.0, options) == pytest.approx(20.0)


def test_installed_providers_are_measured_beside_the_processor() -> None:
    found = [runs_on.provider for runs_on in usable_providers(["CUDAExecutionProvider", "OddProvider"])]
    assert found[0] == "cpu"
    assert found[-1] == "cuda"
