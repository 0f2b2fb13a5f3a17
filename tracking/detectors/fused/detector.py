"""A network and a learned background that together detect people."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats, heights, iou
from tracking.detectors.background.detector import BackgroundDetector, ForegroundScan
from tracking.detectors.background.motion import STILL, Motion
from tracking.detectors.base import Image, Mask, Relight
from tracking.detectors.fused.carried_boxes import CarriedBoxes
from tracking.detectors.fused.explanation import (
    FusedHypotheses,
    FusionWeights,
    NetworkBoxes,
    explain_frame,
    to_log_odds,
    to_probability,
)
from tracking.detectors.fused.reliance import NetworkReliance
from tracking.detectors.fused.schedule import NetworkSchedule
from tracking.detectors.fused.still_silhouettes import StillSilhouettes
from tracking.types import Detections

_WEIGHTS = FusionWeights()
_SURE, _NETWORK_SHARE = 0.5, 0.5
"""Least probability of a network box that enters a person's sides, and its share in them."""
_AGREED, _CERTAIN = 0.4, 0.8
"""Least gain per visible area, and least probability of the network, of people whose height is learned."""
_MARGIN, _COVERED = 0.03, 0.05
"""Least distance of whole people to the border, in heights, and largest overlap (IoU) with one in front."""

_CLEAR = 0.6
"""Least gain per visible area of a clear silhouette."""
_CROSSING = 0.2
"""Overlap (IoU) of two people from which they are about to cross."""
_CONFIRMING = 0.1
"""Least probability of a network box that confirms a silhouette."""
_KNOWN = 0.3
"""Least overlap (IoU) of a person with one who was there at the last run; below, somebody is new."""


class PersonNetwork(Protocol):
    """A network that finds people in single images; its scores are probabilities."""

    def find(self, image: Image, relight: Relight | None = None) -> Detections:
        """Return the people in an image `(H, W, 3)`, without appearance.

        `relight` changes the light of an image of any size: best of the one that the network is shown.
        """
        ...


@dataclass(frozen=True, slots=True)
class FusedSettings:
    """How a network and the background are combined.

    Raises:
        ValueError: a setting is out of range.
    """

    min_probability: float = 0.25  # least probability of a person who explains foreground
    max_unexplained: float = (
        0.2  # share of the image that is foreground but not the network's: beyond, it detects alone
    )
    network_interval_s: float = (
        0.2  # seconds between two runs of the network; half where needed; 0: every frame
    )

    def __post_init__(self) -> None:
        for name in ("min_probability", "max_unexplained"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise ValueError(f"{name} is between 0 and 1, not {getattr(self, name)}")
        if self.network_interval_s < 0.0:
            raise ValueError(f"network_interval_s is at least 0, not {self.network_interval_s}")


class FusedDetector:
    """Detects people by a network and by the foreground's silhouettes. Deterministic.

    While the background is unknown, or much of the foreground is unexplained, the network detects alone.
    """

    warming_up = False

    def __init__(
        self,
        background: BackgroundDetector,
        network: PersonNetwork,
        settings: FusedSettings | None = None,
    ) -> None:
        """Take over a background detector, which nobody else uses, and a network."""
        self.settings = settings or FusedSettings()
        self._background = background
        self.network = network
        self._schedule = NetworkSchedule(self.settings.network_interval_s, background.fps)
        self._run_s = self._schedule.every / background.fps
        self._carried = CarriedBoxes()
        self._reliance = NetworkReliance()
        self._still = StillSilhouettes()
        self._last_run = 0
        self._known = np.empty((0, 4))
        """The people at the last run of the network, in cells."""
        self._is_needed = True
        self._frame = -1

    @property
    def frames_per_run(self) -> int:
        """Frames per regular run of the network."""
        return self._schedule.every

    def run_network_less_often(self, factor: int) -> None:
        """Run the network once in ``factor`` intervals from now on; 1: in every interval."""
        self._schedule.stretch(factor)
        self._run_s = self._schedule.every / self._background.fps

    def cover(self, boxes: Floats) -> None:
        """Ignore the covered part of the images, as :meth:`BackgroundDetector.cover`."""
        self._background.cover(boxes)

    @property
    def flicker(self) -> Mask | None:
        """Where the images flicker, as :attr:`BackgroundDetector.flicker`."""
        return self._background.flicker

    @property
    def camera_motion(self) -> Floats | None:
        """How the picture has moved, as :attr:`BackgroundDetector.camera_motion`."""
        return self._background.camera_motion

    @property
    def appearance_bins(self) -> int:
        """The length of a row of the histograms."""
        return self._background.appearance_bins

    def prepare(self, images: Iterable[Image], every_s: float) -> None:
        """Learn the background and the height model from a recording, an image every so many seconds.

        Raises:
            ValueError: not `(H, W, 3)` uint8 images of one size.
        """
        found: list[Detections] = []

        def searched() -> Iterator[Image]:
            for image in images:
                found.append(self.network.find(image))
                yield image

        self._background.prepare(searched(), every_s)
        for people in found:
            in_work = replace(people, boxes=self._background.grid.image_to_work(people.boxes))
            network = self._to_cells(in_work)
            self._background.observe_people(network.boxes[self._is_whole(network)], every_s)

    def detect(self, image: Image, frame: int | None = None) -> Detections:
        """Return the detections of the next frame, with probabilities as scores.

        Raises:
            ValueError: not an `(H, W, 3)` uint8 image, or another size than before.
        """
        self._frame = self._frame + 1 if frame is None else frame
        work_image = self._background.to_work_image(image)
        scan = self._background.scan(work_image)
        runs = self._schedule.is_due(self._frame, needed=self._is_needed)
        if runs:
            found = self.network.find(image, self._background.relit)
            in_work = self._background.grid.image_to_work(found.boxes)
            self._carried.renew(work_image, replace(found, boxes=in_work))
        else:
            self._carried.carry(work_image)
        found = self._carried.found
        if scan is None:
            return self._network_alone(work_image, found)
        network = self._to_cells(found, scan.motion)
        if self._is_flooded(scan, network):
            self._background.learn(scan, network.boxes[found.scores >= self.settings.min_probability])
            return self._network_alone(work_image, found)
        fused = self._explain(scan, network)
        if runs:
            is_clear = fused.silhouettes[: fused.person_count] >= _CLEAR
            self._reliance.observe(fused.supports[: fused.person_count][is_clear] >= 0)
            self._background.observe_people(self._agreed_people(fused, network), self._run_s)
            self._known = fused.boxes[: fused.person_count]
            self._observe_still(fused, network)
        self._is_needed = self._needs_network(fused)
        self._background.learn(scan, fused.boxes[: fused.person_count])
        return self._background.detections(
            scan.image, _average_sides(fused, network), to_probability(fused.log_odds), scan.mask, scan.motion
        )

    def _network_alone(self, work_image: Image, found: Detections) -> Detections:
        """Return the network's boxes of a frame; the network is needed soon again."""
        self._is_needed = True
        boxes = self._background.grid.work_to_cells(found.boxes)
        return self._background.detections(work_image, boxes, found.scores)

    def _observe_still(self, fused: FusedHypotheses, network: NetworkBoxes) -> None:
        """Record which silhouettes this run of the network confirms."""
        is_confirmed = fused.supports >= 0
        is_confirmed[is_confirmed] = network.log_odds[fused.supports[is_confirmed]] >= to_log_odds(
            np.array(_CONFIRMING)
        )
        seconds = min((self._frame - self._last_run) / self._background.fps, self._run_s)
        shown = (fused.silhouettes >= _AGREED) | is_confirmed
        self._still.update(fused.boxes[shown], is_confirmed[shown], seconds, self._reliance.share)
        self._last_run = self._frame

    def _needs_network(self, fused: FusedHypotheses) -> bool:
        """Return whether somebody seems to be new or two people are about to cross."""
        people = fused.boxes[: fused.person_count]
        overlaps = np.triu(iou(people[:, None], people[None]), 1)
        is_new = iou(people[:, None], self._known[None]).max(axis=1, initial=0.0) < _KNOWN
        return bool((overlaps >= _CROSSING).any() or is_new.any())

    def _to_cells(self, found: Detections, motion: Motion = STILL) -> NetworkBoxes:
        """Return boxes in pixels of the working image in cells of the background."""
        return NetworkBoxes(self._background.to_cells(found.boxes, motion), to_log_odds(found.scores))

    def _explain(self, scan: ForegroundScan, network: NetworkBoxes) -> FusedHypotheses:
        least = float(to_log_odds(np.array(self.settings.min_probability)))
        # However uncertain the height of people is, those that the network sees may all be there.
        seen = int(np.count_nonzero(network.log_odds >= least))
        fit = replace(scan.fit, max_people=max(scan.fit.max_people, seen))
        body = self._background.settings.box_filter.body
        weights = replace(_WEIGHTS, unsupported=self._reliance.share * _WEIGHTS.unsupported)
        return explain_frame(scan, network, body, fit, weights, least, self._still)

    def _is_flooded(self, scan: ForegroundScan, network: NetworkBoxes) -> bool:
        """Return whether much of the image is foreground outside of the network's boxes."""
        rest = scan.foreground.copy()
        for left, top, right, bottom in np.maximum(np.rint(network.boxes), 0.0).astype(np.int64).tolist():
            rest[top:bottom, left:right] = 0.0
        return float(rest.sum()) > self.settings.max_unexplained * float(scan.weight.sum())

    def _agreed_people(self, fused: FusedHypotheses, network: NetworkBoxes) -> Floats:
        """Return the network's boxes `(K, 4)` of whole people where silhouettes confirm it."""
        count = fused.person_count
        agreed = fused.supports[:count][fused.silhouettes[:count] >= _AGREED]
        agreed = agreed[agreed >= 0]
        return network.boxes[agreed[self._is_whole(network)[agreed]]]

    def _is_whole(self, network: NetworkBoxes) -> npt.NDArray[np.bool_]:
        """Return which sure network boxes are inside the image and covered by no other, `(N,)`."""
        boxes = network.boxes
        reach = _MARGIN * heights(boxes)[:, None]
        first, last = self._background.grid.bounds
        is_inside = (boxes[:, :2] - reach >= first).all(axis=1) & (boxes[:, 2:] + reach <= last).all(axis=1)
        is_in_front = boxes[:, 3][None] > boxes[:, 3][:, None]
        is_covered = ((iou(boxes[:, None], boxes[None]) > _COVERED) & is_in_front).any(axis=1)
        return np.asarray(is_inside & ~is_covered & (network.log_odds >= to_log_odds(np.array(_CERTAIN))))


def _average_sides(fused: FusedHypotheses, network: NetworkBoxes) -> Floats:
    """Return the boxes `(K, 4)` in cells, averaged with the network's where it is sure."""
    boxes = fused.boxes.copy()
    supported = np.flatnonzero(fused.supports >= 0)
    supporting = fused.supports[supported]
    is_sure = network.log_odds[supporting] >= to_log_odds(np.array(_SURE))
    supported, supporting = supported[is_sure], supporting[is_sure]
    boxes[supported] += _NETWORK_SHARE * (network.boxes[supporting] - boxes[supported])
    return boxes
