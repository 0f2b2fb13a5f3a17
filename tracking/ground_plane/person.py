"""A person who is tracked on the ground plane: motion, appearance and size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.appearance import appearance_distance_matrix
from tracking.boxes import Floats
from tracking.ground_plane.motion import MotionState, follow
from tracking.ground_plane.places.hypotheses import Places
from tracking.ground_plane.predicted_boxes import PersonBoxes
from tracking.ground_plane.settings import GroundSettings

_TEMPLATE_MEMORY_S = 2.4
"""Seconds of detections that a person's histogram is the mean of."""
_UNKNOWN = np.zeros(0)


class GroundPerson:
    """The state of a person after the last final frame. `settings` have how people move.

    Attributes:
        id: from 1, never reused; exchanged with another person's if they were taken for each other.
        state: place and velocity in the frame in which they were seen last.
        seen: that frame.
        clearly_seen: the last one in which a detection that is not unlikely showed them.
        boxes: their size.
        misplacement: (2, 2) covariance of the place's error if the feet were wrong.
    """

    __slots__ = (
        "_histograms",
        "_seconds",
        "_update_rate",
        "boxes",
        "clearly_seen",
        "id",
        "misplacement",
        "seen",
        "state",
    )

    def __init__(
        self, number: int, frame: int, places: Places, k: int, seconds: float, settings: GroundSettings
    ) -> None:
        """Create a person who arrives at place `k` of a frame; frames are `seconds` apart."""
        self.id = number
        self.seen = self.clearly_seen = frame
        self.state = MotionState.at(places.means[k], places.covariances[k], settings.speed)
        self.boxes = PersonBoxes()
        self.misplacement = places.misplacements[k]
        self._seconds = seconds
        self._update_rate = min(seconds / _TEMPLATE_MEMORY_S, 1.0)
        self._histograms: dict[int, Floats] = {}

    def ahead(self, frame: int, settings: GroundSettings) -> MotionState:
        """Return the predicted state in a frame after the last one seen."""
        return self.state.predict(self.seconds_unseen(frame), settings.acceleration)

    def seconds_unseen(self, frame: int) -> float:
        """Return the seconds from the frame in which they were seen last to another."""
        return self._seconds * (frame - self.seen)

    def has_left(self, frame: int, settings: GroundSettings) -> bool:
        """Return whether nobody has seen them for long, or only by detections that are unlikely."""
        unclear = self._seconds * (frame - self.clearly_seen)
        return (
            self.seconds_unseen(frame) > settings.forget_after_s or unclear > settings.forget_unclear_after_s
        )

    def move(self, frame: int, places: Places, k: int, settings: GroundSettings) -> None:
        """Move to place `k` of a frame."""
        seconds, misplacement = self.seconds_unseen(frame), places.misplacements[k]
        mean, covariance = places.means[k], places.covariances[k]
        self.state = follow(self.state, seconds, mean, covariance, self.misplacement + misplacement, settings)
        self.seen, self.misplacement = frame, misplacement
        if places.is_clear[k]:
            self.clearly_seen = frame

    def template(self, camera: int) -> Floats:
        """Return the mean histogram in a camera, (B,); B = 0: not known."""
        return self._histograms.get(camera, _UNKNOWN)

    def learn(self, places: Places, k: int, usual: Floats) -> None:
        """Learn appearance and size from the detections of place `k`; `usual` (D, 4): others' boxes there."""
        measurements = places.measurements
        for index in places.groups[k]:
            camera, histogram = int(measurements.camera[index]), measurements.histograms[index]
            known = self._histograms.get(camera)
            if known is not None and len(known) == len(histogram):
                histogram = known + self._update_rate * (histogram - known)
            if len(histogram):
                self._histograms[camera] = histogram
            if not places.misplaced[k, index]:
                self.boxes.update(measurements.boxes[index], usual[index])


def _light_change(distances: Floats, log_odds: Floats) -> float:
    """Return by how much a camera's picture makes everybody look different from before.

    `distances` (P, D): of people's appearances to the detections of a frame, with `log_odds` (D,) of being
    people. Most detections are of somebody known: how far they are from whom they resemble most is due to the
    light, and says nothing about who they are.
    """
    clear = log_odds > 0.0
    return float(np.median(distances.min(axis=0)[clear])) if clear.any() else 0.0


def appearance_costs(people: Sequence[GroundPerson], places: Places, settings: GroundSettings) -> Floats:
    """Return the costs of the K places by people's appearance in the cameras that see them, (P, K)."""
    measurements = places.measurements
    costs = np.zeros((len(people), len(measurements)))
    if not costs.size or not len(places):
        return np.zeros((len(people), len(places)))
    for camera in np.unique(measurements.camera).tolist():
        seen = np.flatnonzero(measurements.camera == camera)
        looks = np.stack([measurements.histograms[index] for index in seen])
        templates = [person.template(camera) for person in people]
        known = np.flatnonzero([len(template) == looks.shape[1] > 0 for template in templates])
        if len(known):
            chosen = np.stack([templates[n] for n in known.tolist()])
            distances = appearance_distance_matrix(chosen, looks)
            unknown = max(settings.unknown_appearance, _light_change(distances, measurements.log_odds[seen]))
            costs[np.ix_(known, seen)] = settings.appearance * (distances - unknown)
    members = np.concatenate([np.array(group) for group in places.groups])
    begins = np.cumsum([0, *(len(group) for group in places.groups[:-1])])
    return np.asarray(np.add.reduceat(costs[:, members], begins, axis=1))
