"""The fused detector: network and silhouettes support each other, and each detects where the other fails."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import cv2
import numpy as np
import pytest

from fakes.tracking.drawn_people import HEIGHT, WIDTH, Figure, picture
from tracking.boxes import Floats, iou
from tracking.detectors import BackgroundDetector, FusedDetector, FusedSettings
from tracking.detectors.base import Image, Relight
from tracking.detectors.fused.explanation import consider_wrong_people, to_probability
from tracking.types import Detections

WALKER = Figure(10, 200, speed=2.0, begin=40)
OTHER = Figure(300, 230, speed=-1.0, begin=40)
POSTER = np.array([150.0, 40.0, 180.0, 110.0])

Finder = Callable[[int], Sequence[tuple[Floats, float]]]


class ListedNetwork:
    """A network that finds the listed boxes, with their scores, in each frame."""

    def __init__(self, finder: Finder) -> None:
        self._finder = finder
        self.frame = 0
        self.runs: list[int] = []

    def find(self, image: Image, relight: Relight | None = None) -> Detections:
        """Return the boxes of the current frame."""
        del relight
        assert image.ndim == 3
        self.runs.append(self.frame)
        listed = self._finder(self.frame)
        boxes = np.array([box for box, _ in listed]).reshape(-1, 4)
        return Detections(boxes, np.array([score for _, score in listed]), np.empty((len(listed), 0)))


def detect_all(
    finder: Finder, figures: Sequence[Figure], frames: range, gain: Callable[[int], float] = lambda _: 1.0
) -> list[Detections]:
    network = ListedNetwork(finder)
    detector = FusedDetector(BackgroundDetector(), network)
    found = []
    for network.frame in frames:
        found.append(detector.detect(picture(figures, network.frame, gain(network.frame)), network.frame))
    return found


def score_at(found: Detections, box: Floats) -> float:
    """Return the best score of the detections on a box."""
    return float(found.scores[iou(found.boxes, box) >= 0.5].max(initial=0.0))


def mean_score(found: list[Detections], figure: Figure, frames: range) -> float:
    return float(np.mean([score_at(found[frame], figure.box(frame)) for frame in frames]))


def test_network_and_silhouette_together_are_surer_than_each_alone() -> None:
    both = detect_all(lambda frame: [(WALKER.box(frame), 0.7)], [WALKER], range(120))
    silhouette = detect_all(lambda _: [], [WALKER], range(120))
    frames = range(80, 120)
    assert mean_score(both, WALKER, frames) > 0.9
    assert 0.3 < mean_score(silhouette, WALKER, frames) < 0.8


@pytest.mark.parametrize("light", [1.0, 0.3])
def test_the_network_is_shown_pictures_of_the_dark_in_the_usual_light(light: float) -> None:
    shown: list[Image] = []

    class WatchedNetwork(ListedNetwork):
        def find(self, image: Image, relight: Relight | None = None) -> Detections:
            shown.append(image if relight is None else relight(image))
            return super().find(image)

    detector = FusedDetector(BackgroundDetector(), WatchedNetwork(lambda _: []))
    for frame in range(90):
        image = picture([WALKER], frame, 1.0 if frame < 60 else light)
        detector.detect(image, frame)
    error = np.abs(shown[-1].astype(np.float64) - picture([WALKER], 85, 1.0)).mean()
    assert error < 10.0
    # In the usual light it is shown what the camera shows.
    assert light < 1.0 or any(np.array_equal(shown[-1], picture([WALKER], frame)) for frame in range(90))


@pytest.mark.parametrize("is_foggy", [False, True])
def test_a_large_picture_that_is_reduced_first_is_relit_to_the_same(*, is_foggy: bool) -> None:
    veil = np.linspace(0.7, 0.4, HEIGHT)[:, None, None]
    detector = BackgroundDetector()
    for frame in range(90):
        image = picture([WALKER], frame, 0.6 if frame >= 60 and not is_foggy else 1.0)
        if frame >= 60 and is_foggy:
            image = np.asarray(image + (190.0 - image) * veil, dtype=np.uint8)
        detector.scan(detector.to_work_image(image))
    large, size = cv2.resize(image, None, fx=6.0, fy=6.0), (300, 300)
    reduced = np.asarray(cv2.resize(large, size), dtype=np.uint8)
    shown = detector.relit(reduced).astype(np.float64)
    assert np.abs(shown - cv2.resize(detector.relit(large), size)).mean() < 1.0
    assert np.abs(shown - reduced).mean() > 10.0, "it was relit"


def test_a_network_box_without_foreground_is_doubted() -> None:
    found = detect_all(lambda _: [(POSTER, 0.8)], [WALKER], range(120))
    assert max(score_at(found[frame], POSTER) for frame in range(60, 120)) < 0.5


def test_of_two_people_the_one_that_the_network_misses_is_found_by_the_silhouette() -> None:
    found = detect_all(lambda frame: [(WALKER.box(frame), 0.9)], [WALKER, OTHER], range(130))
    frames = range(90, 130)
    assert mean_score(found, WALKER, frames) > 0.9
    assert 0.3 < mean_score(found, OTHER, frames) < mean_score(found, WALKER, frames)


def test_a_thing_that_stands_still_is_no_person_after_some_seconds_although_people_pass_it() -> None:
    thing = Figure(150, 220, speed=0.0, begin=60)
    walkers = [Figure(10, 200, speed=1.0, begin=40), thing]

    found = detect_all(lambda frame: [(walkers[0].box(frame), 0.9)], walkers, range(300))
    assert mean_score(found, thing, range(80, 100)) > 0.3
    assert mean_score(found, thing, range(270, 300)) < 0.25


def test_a_person_is_counted_once() -> None:
    shift = np.array([6.0, -4.0, 6.0, -4.0])
    found = detect_all(
        lambda frame: [(WALKER.box(frame), 0.9), (WALKER.box(frame) + shift, 0.6)],
        [WALKER],
        range(110),
    )
    for frame in range(80, 110):
        assert np.count_nonzero(found[frame].scores >= 0.5) == 1


def test_while_the_background_is_unknown_the_network_detects_alone() -> None:
    early = Figure(10, 200, speed=2.0)
    found = detect_all(lambda frame: [(early.box(frame), 0.8)], [early], range(3))
    for frame, detections in enumerate(found):
        np.testing.assert_allclose(detections.boxes, [early.box(frame)], atol=0.3)
        np.testing.assert_allclose(detections.scores, [0.8])


def test_when_the_picture_changes_at_once_the_network_detects_alone() -> None:
    moved = Figure(10, 200, speed=2.0)
    network = ListedNetwork(lambda frame: [(moved.box(frame), 0.8)])
    detector = FusedDetector(BackgroundDetector(), network)
    for network.frame in range(60):
        detector.detect(picture([], network.frame))
    network.frame = 60
    turned = np.ascontiguousarray(np.flipud(picture([], 60)))
    found = detector.detect(turned, 60)
    np.testing.assert_allclose(found.boxes, [moved.box(60)])


def test_between_two_runs_of_the_network_its_boxes_are_carried_along() -> None:
    network = ListedNetwork(lambda frame: [(WALKER.box(frame), 0.9)] if frame >= WALKER.begin else [])
    detector = FusedDetector(BackgroundDetector(), network)
    scores = []
    for network.frame in range(120):
        found = detector.detect(picture([WALKER], network.frame), network.frame)
        scores.append(score_at(found, WALKER.box(network.frame)))
    assert [run for run in network.runs if run >= 80] == list(range(80, 120, 5))
    assert min(scores[80:]) > 0.9


def test_the_network_runs_earlier_for_somebody_new() -> None:
    late = Figure(200, 210, speed=1.0, begin=92)
    network = ListedNetwork(lambda frame: [(WALKER.box(frame), 0.9)] if frame >= WALKER.begin else [])
    detector = FusedDetector(BackgroundDetector(), network)
    for network.frame in range(100):
        detector.detect(picture([WALKER, late], network.frame), network.frame)
    assert [run for run in network.runs if run >= 90][:2] == [90, 93]


def test_where_the_network_finds_nobody_the_silhouettes_count_as_without_it() -> None:
    walkers = [Figure(10 + 80 * k, 170 + 25 * k, speed=0.5, begin=40) for k in range(3)]
    found = detect_all(lambda _: [], walkers, range(160))
    for walker in walkers:
        assert mean_score(found, walker, range(140, 160)) > 0.7


def test_heights_are_learned_from_people_of_whom_both_are_sure() -> None:
    # The blobs are those of pairs who walk side by side: nobody is alone.
    pairs = [
        Figure(10 + 40 * place, foot, speed=1.0, begin=40, color=color)
        for foot in (180, 230)
        for place, color in ((0, (40, 60, 190)), (0.7, (190, 60, 40)))
    ]
    network = ListedNetwork(lambda frame: [(pair.box(frame), 0.95) for pair in pairs])
    background = BackgroundDetector()
    detector = FusedDetector(background, network)
    for network.frame in range(120):
        detector.detect(picture(pairs, network.frame), network.frame)
    assert background.height_model is not None
    for foot in (180.0, 230.0):
        expected = 0.7 * foot - 40.0
        assert background.height_model.expected_height(np.array([foot]))[0] == pytest.approx(
            expected, rel=0.1
        )


def test_a_recording_is_prepared_by_network_and_background() -> None:
    network = ListedNetwork(lambda frame: [(WALKER.box(frame), 0.9)] if frame >= WALKER.begin else [])
    detector = FusedDetector(BackgroundDetector(), network)

    def scanned() -> Iterator[Image]:
        for network.frame in range(0, 160, 20):
            yield picture([WALKER], network.frame)

    detector.prepare(scanned(), every_s=0.8)
    network.frame = 100
    found = detector.detect(picture([WALKER], 100))
    assert score_at(found, WALKER.box(100)) > 0.9
    assert found.boxes.max() <= WIDTH


def test_settings_are_shares() -> None:
    with pytest.raises(ValueError, match=r"min_probability is between 0 and 1, not 1.5"):
        FusedSettings(min_probability=1.5)


def test_an_alternative_is_as_likely_as_the_person_it_could_replace_is_doubtful() -> None:
    person, other, away = [0.0, 0.0, 10.0, 30.0], [4.0, 2.0, 14.0, 32.0], [50.0, 0.0, 60.0, 30.0]
    boxes = np.array([person, other, away])

    def alternatives(log_odds_of_person: float) -> Floats:
        odds = consider_wrong_people(boxes, np.array([log_odds_of_person, -5.0, -5.0]), 1)
        assert odds[0] == log_odds_of_person
        return to_probability(odds[1:])

    sure, doubtful = alternatives(6.0), alternatives(0.0)
    assert sure[0] < 0.01
    assert 0.05 < doubtful[0] < 0.2
    np.testing.assert_allclose([sure[1], doubtful[1]], to_probability(np.array(-5.0)))
    assert len(consider_wrong_people(np.empty((0, 4)), np.empty(0), 0)) == 0
