"""The ONNX detector: all YOLO layouts are read, and unsupported models are refused in one line."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from fakes.tracking.tiny_networks import save_network, yolov5, yolov8
from tracking.detectors import Image, OnnxDetector, OnnxSettings
from tracking.detectors.neural.yolo_output import decode_output

# The picture is twice as large as the input and has its proportions: no bars.
WHITE = np.full((128, 192, 3), 255, dtype=np.uint8)
# In pixels of the input: middle, width and height; and the same box in the picture.
MIDDLE, BOX = (30.0, 32.0, 12.0, 40.0), [48.0, 24.0, 72.0, 104.0]
NEAR = (31.0, 32.0, 12.0, 40.0)
AWAY = (70.0, 32.0, 12.0, 40.0)


def detector(path: Path, **settings: object) -> OnnxDetector:
    return OnnxDetector(OnnxSettings(model=path, **settings))  # type: ignore[arg-type]


V5 = yolov5([(*MIDDLE, 0.9, 0.8, 0.1), (*NEAR, 0.8, 0.8, 0.1), (*AWAY, 0.9, 0.05, 0.9)])
V8 = yolov8([(*MIDDLE, 0.72, 0.1), (*NEAR, 0.64, 0.1), (*AWAY, 0.05, 0.9)])
END = yolov5([(24, 12, 36, 52, 0.72, 0), (64, 12, 76, 52, 0.9, 1)], boxes=5)


@pytest.mark.parametrize("table", [V5, V8, END], ids=["yolov5", "yolov8", "end2end"])
def test_a_person_is_found_once_and_other_classes_are_not(
    tmp_path: Path, table: npt.NDArray[np.float32]
) -> None:
    seen = detector(save_network(tmp_path / "tiny.onnx", table)).detect(WHITE)
    np.testing.assert_allclose(seen.boxes, [BOX], atol=1e-4)
    np.testing.assert_allclose(seen.scores, [0.72], rtol=1e-5)
    assert seen.histograms.shape == (1, 96)


def test_configured_classes_are_detected(tmp_path: Path) -> None:
    one = detector(save_network(tmp_path / "tiny.onnx", V8), classes=(0, 1))
    np.testing.assert_allclose(one.detect(WHITE).scores, [0.9, 0.72], rtol=1e-5)
    with pytest.raises(ValueError, match="no class 7"):
        detector(tmp_path / "tiny.onnx", classes=(7,))


def test_boxes_below_min_score_are_dropped(tmp_path: Path) -> None:
    assert len(detector(save_network(tmp_path / "tiny.onnx", V8), min_score=0.8).detect(WHITE)) == 0


def test_boxes_are_mapped_back_from_the_letterboxed_input(tmp_path: Path) -> None:
    path = save_network(tmp_path / "tiny.onnx", V8, size=(96, 96))
    wide = np.full((64, 192, 3), 255, dtype=np.uint8)  # half its size in the input, 32 rows of bar above
    seen = detector(path, min_score=0.1).detect(wide)
    # The bars have brightness 114 of 255, which scales the score of this network.
    np.testing.assert_allclose(seen.scores, [0.72 * 114 / 255], rtol=1e-3)
    np.testing.assert_allclose(seen.boxes, [[48, 0, 72, 40]], atol=1e-4)


def test_a_model_with_dynamic_size_gets_the_configured_size(tmp_path: Path) -> None:
    path = save_network(tmp_path / "tiny.onnx", V8, size=("height", "width"))
    square = np.full((200, 200, 3), 255, dtype=np.uint8)
    seen = detector(path, input_size=100).detect(square)
    np.testing.assert_allclose(seen.boxes, [BOX], atol=1e-4)


def test_half_precision_models_are_supported(tmp_path: Path) -> None:
    seen = detector(save_network(tmp_path / "tiny.onnx", V8, kind="FLOAT16")).detect(WHITE)
    np.testing.assert_allclose(seen.boxes, [BOX], atol=0.1)


def test_an_unsupported_model_is_refused_in_one_line(tmp_path: Path) -> None:
    noise = tmp_path / "noise.onnx"
    noise.write_bytes(b"no network")
    refused = {
        noise: "not a usable ONNX file",
        save_network(tmp_path / "flat.onnx", V8[0]): r"output has the shape \(6, 20\)",
        save_network(tmp_path / "thin.onnx", yolov5([(1.0, 2.0, 3.0, 4.0)])): r"shape \(1, 20, 4\)",
    }
    for path, message in refused.items():
        with pytest.raises(ValueError, match=message) as caught:
            detector(path)
        assert path.name in str(caught.value)
        assert "\n" not in str(caught.value)
    with pytest.raises(OSError, match=r"none\.onnx"):
        detector(tmp_path / "none.onnx")


def test_without_onnxruntime_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = save_network(tmp_path / "tiny.onnx", V8)
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(ImportError, match=r"pip install 'myview\[neural\]'"):
        detector(path)


def test_a_configured_layout_overrides_the_shape() -> None:
    one_class = yolov5([(*MIDDLE, 0.9, 0.8)], boxes=300)
    found = decode_output(one_class, "yolov5", (0,))
    np.testing.assert_allclose(found.boxes[0], [24, 12, 36, 52])
    np.testing.assert_allclose(found.scores[0], 0.72)
    by_shape = decode_output(one_class, "auto", (0,))
    np.testing.assert_allclose(by_shape.boxes[0], MIDDLE, err_msg="the shape alone means end to end")


def test_boxes_are_mapped_back_from_the_stretched_input(tmp_path: Path) -> None:
    path = save_network(tmp_path / "tiny.onnx", V8, size=(96, 96))
    wide = np.full((64, 192, 3), 255, dtype=np.uint8)  # half as wide in the input, and half as high again
    seen = detector(path, resize="stretch").detect(wide)
    np.testing.assert_allclose(seen.scores, [0.72], rtol=1e-5)
    left, top, width, height = MIDDLE[0] - MIDDLE[2] / 2, MIDDLE[1] - MIDDLE[3] / 2, MIDDLE[2], MIDDLE[3]
    expected = [2 * left, top / 1.5, 2 * (left + width), (top + height) / 1.5]
    np.testing.assert_allclose(seen.boxes, [expected], atol=1e-4)


@pytest.mark.parametrize(
    ("resize", "reduced"), [("stretch", (64, 96)), ("letterbox", (54, 96))], ids=["stretch", "letterbox"]
)
def test_a_picture_is_relit_at_the_size_of_the_input(
    tmp_path: Path, resize: str, reduced: tuple[int, int]
) -> None:
    sizes: list[tuple[int, ...]] = []

    def to_a_third(image: Image) -> Image:
        sizes.append(image.shape[:2])
        return np.full_like(image, 85)

    network = detector(save_network(tmp_path / "tiny.onnx", V8), resize=resize, min_score=0.0)
    white = np.full((1080, 1920, 3), 255, dtype=np.uint8)
    before, after = (network.find(white, relight).scores.max() for relight in (None, to_a_third))
    assert sizes == [reduced]
    # The scores of this network grow with the brightness of what it is shown; bars are not relit.
    assert after < before if resize == "stretch" else after == before


def test_a_network_sees_the_mean_of_what_is_finer_than_its_pixels(tmp_path: Path) -> None:
    shown: list[Image] = []

    def keep(image: Image) -> Image:
        shown.append(image)
        return image

    network = detector(save_network(tmp_path / "tiny.onnx", V8))
    noise = np.random.default_rng(1).integers(0, 256, (1080, 1920, 3), dtype=np.uint8)
    network.find(noise, keep)
    # Means of 20 by 20 pixels; a few of them would have a deviation of 40.
    assert shown[0].std() < 6.0


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_rows_that_are_not_finite_are_nobody_and_an_output_without_others_is_refused(wrong: float) -> None:
    output = yolov5([(*MIDDLE, 0.9, 0.8), (*AWAY, 0.9, 0.9)], boxes=2)
    output[0, 1, 2] = wrong
    np.testing.assert_allclose(decode_output(output, "yolov5", (0,)).boxes, [[24.0, 12.0, 36.0, 52.0]])
    with pytest.raises(ValueError, match="no finite numbers"):
        decode_output(np.full_like(output, wrong), "yolov5", (0,))
