"""What the background no longer explains is learned again: another view, a covered lens, and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fakes.tracking.drawn_people import HEIGHT, WIDTH, Figure, Picture, detect_all, picture
from tracking.boxes import iou
from tracking.detectors import BackgroundDetector
from tracking.types import Detections

SURE = 0.4
FPS = 25
WALKER = Figure(10, 200, speed=2.0)


PATCHES = np.random.default_rng(7).integers(30, 220, (12, 15, 3)).repeat(24, axis=0).repeat(24, axis=1)


def turned(figures: Sequence[Figure], frame: int) -> Picture:
    """Return the picture of the camera when it looks elsewhere; people stand upright in it."""
    here, empty = picture(figures, frame), picture([], frame)
    person = (np.abs(here.astype(int) - empty) > 0).any(axis=2)
    return np.where(person[..., None], here, PATCHES).astype(np.uint8)


def sure_boxes(seen: Detections) -> npt.NDArray[np.float64]:
    return seen.boxes[seen.scores >= SURE]


def test_another_view_is_learned_within_two_seconds_while_somebody_walks() -> None:
    detector = BackgroundDetector()
    detect_all(detector, [], range(60))
    overlaps, seen_people = [], 0
    for frame in range(5 * FPS):
        seen = detector.detect(turned([WALKER], frame))
        if frame >= 2 * FPS:
            assert not detector.warming_up
            overlaps.append(float(iou(sure_boxes(seen), WALKER.box(frame)).max(initial=0.0)))
            seen_people += len(sure_boxes(seen))
    assert np.mean(np.array(overlaps) >= 0.4) >= 0.9
    assert seen_people <= 1.3 * len(overlaps)


def test_no_one_is_detected_while_the_view_is_unknown() -> None:
    detector = BackgroundDetector()
    detect_all(detector, [], range(60))
    seen = [detector.detect(turned([], frame)) for frame in range(3 * FPS)]
    assert not any(len(sure_boxes(each)) for each in seen[FPS // 2 :])


def test_after_a_covered_lens_all_is_as_before_at_once() -> None:
    detector = BackgroundDetector()
    detect_all(detector, [WALKER], range(60))
    dark = np.random.default_rng(2).normal(18.0, 3.0, (HEIGHT, WIDTH, 3)).clip(0, 255).astype(np.uint8)
    covered = [detector.detect(dark) for _ in range(5 * FPS)]
    assert detector.warming_up
    assert not any(len(sure_boxes(each)) for each in covered[FPS // 2 :])
    after = detect_all(detector, [WALKER], range(60, 120))
    found = [
        float(iou(sure_boxes(seen), WALKER.box(60 + k)).max(initial=0.0)) for k, seen in enumerate(after)
    ]
    assert np.mean(np.array(found[5:]) >= 0.5) >= 0.95


def test_people_look_the_same_at_another_exposure() -> None:
    detector = BackgroundDetector()
    before = detect_all(detector, [WALKER], range(100))[-1]
    after = detect_all(detector, [WALKER], range(100, 103), gain=0.6)[-1]
    looks = [
        seen.histograms[np.argmax(iou(seen.boxes, WALKER.box(frame)))]
        for seen, frame in ((before, 99), (after, 102))
    ]
    assert np.sqrt(looks[0] * looks[1]).sum() > 0.8
