"""The frames that are not final yet, and what they say about the people known before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.ground_plane.camera import BoxSizes, GroundCamera
from tracking.ground_plane.motion import MotionState
from tracking.ground_plane.person import GroundPerson, appearance_costs
from tracking.ground_plane.places.hypotheses import Places
from tracking.ground_plane.places.measurements import Measurements
from tracking.ground_plane.places.visibility import detection_probabilities
from tracking.ground_plane.program.costs import KnownPeople
from tracking.ground_plane.settings import GroundSettings

_MAX_DETECTION_PROBABILITY = 0.97


@dataclass(frozen=True, slots=True, eq=False)
class WindowFrame:
    """A frame and the hypotheses of places in it."""

    number: int
    places: Places


def predict_places(
    people: Sequence[GroundPerson],
    states: Sequence[Sequence[int]],
    window: Sequence[WindowFrame],
    seconds_per_frame: float,
    settings: GroundSettings,
) -> list[tuple[Floats, Floats]]:
    """Return mean and covariance of the place of each person in the frame after the window.

    `states`: their places in each frame, below 0 where there is none; first of the `people` known, then of
    those who arrive.
    """
    predictions = []
    for n, row in enumerate(states):
        seen = [m for m, state in enumerate(row) if state >= 0]
        known = people[n].state if n < len(people) else None
        seconds = seconds_per_frame * (len(window) - seen[-1] if seen else len(window) + 1)
        if seen:
            places = window[seen[-1]].places
            state = MotionState.at(
                places.means[row[seen[-1]]], places.covariances[row[seen[-1]]], settings.speed
            )
            if known is not None:
                joint = state.covariance.copy()
                joint[2:, 2:] = known.velocity_covariance
                state = MotionState(np.concatenate([state.place, known.velocity]), joint)
        elif known is not None:
            state = known
            seconds += seconds_per_frame * (window[0].number - 1 - people[n].seen)
        else:
            continue
        ahead = state.predict(seconds, settings.acceleration)
        predictions.append((ahead.place, ahead.place_covariance))
    return predictions


def known_people(
    people: Sequence[GroundPerson],
    window: Sequence[WindowFrame],
    cameras: Sequence[GroundCamera],
    sizes: Sequence[BoxSizes],
    seconds_per_frame: float,
    settings: GroundSettings,
) -> KnownPeople:
    """Return the people known, with what the window's frames say of each."""
    states = MotionState.stack([person.state for person in people])
    unseen = np.array([person.seconds_unseen(window[0].number) for person in people])
    weight = settings.detection_weight(seconds_per_frame)
    hidden = []
    for m, frame in enumerate(window):
        ahead = states.predict(unseen + m * seconds_per_frame, settings.acceleration)
        hidden.append(weight * missed_costs(ahead.place, frame.places.measurements, cameras, sizes, settings))
    appearance = [appearance_costs(people, frame.places, settings) for frame in window]
    misplacements = np.array([person.misplacement for person in people]).reshape(-1, 2, 2)
    return KnownPeople(states, misplacements, unseen, np.stack(hidden, axis=1), appearance)


def missed_costs(
    places: Floats,
    measurements: Measurements,
    cameras: Sequence[GroundCamera],
    sizes: Sequence[BoxSizes],
    settings: GroundSettings,
) -> Floats:
    """Return the costs of people at places (N, 2) being detected by no camera in a frame, (N,)."""
    nobody = np.zeros((len(places), len(measurements)), dtype=np.bool_)
    probabilities = detection_probabilities(
        places, cameras, sizes, measurements, nobody, settings.detection_probability
    )
    return np.asarray(-np.log1p(-np.minimum(probabilities, _MAX_DETECTION_PROBABILITY)).sum(axis=1))
