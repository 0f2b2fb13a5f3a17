"""Costs of places by people's looks, and densities on the plane, against their definitions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from fakes.tracking.walked_floor import FloorNoise, detect_walkers, floor_views
from tracking.appearance import appearance_distance_matrix
from tracking.ground_plane import GroundSettings
from tracking.ground_plane.camera import BoxSizes
from tracking.ground_plane.gaussians import OffsetDensities
from tracking.ground_plane.person import GroundPerson, appearance_costs
from tracking.ground_plane.places.hypotheses import Places, find_places
from tracking.ground_plane.places.measurements import measure
from tracking.ground_plane.predicted_boxes import usual_boxes

VIEWS = floor_views()
CAMERAS = [view.camera for view in VIEWS.values()]
SETTINGS = GroundSettings()
SIZES = [BoxSizes() for _ in CAMERAS]
seeds = st.integers(0, 2**31 - 1)
few = settings(deadline=None, max_examples=25)


def places_with_looks(random: np.random.Generator, people: int) -> Places:
    """Return the places of some people, whose looks are random; those of the last camera are unknown."""
    walks = random.uniform(3.0, 7.0, (1, people, 2))
    found = detect_walkers(walks, VIEWS, FloorNoise(deviation=0.01))[0]
    measurements = measure(CAMERAS, list(found.values()), np.ones(len(CAMERAS)), SETTINGS)
    looks = tuple(
        random.dirichlet(np.ones(5)) if camera < len(CAMERAS) - 1 else np.zeros(0)
        for camera in measurements.camera
    )
    return find_places(replace(measurements, histograms=looks), [], CAMERAS, SIZES, SETTINGS, 0.04)


@few
@given(seeds, st.integers(0, 3))
def test_appearance_costs_are_the_sum_over_the_detections_of_a_place(seed: int, people: int) -> None:
    random = np.random.default_rng(seed)
    before, places = places_with_looks(random, 3), places_with_looks(random, 3)
    known = [GroundPerson(k, 0, before, k, 0.04, SETTINGS) for k in range(people)]
    for k, person in enumerate(known):
        person.learn(before, k, usual_boxes(before.measurements, SIZES))
    costs = appearance_costs(known, places, SETTINGS)
    assert costs.shape == (people, len(places))
    for person, row in zip(known, costs, strict=True):
        for group, cost in zip(places.groups, row, strict=True):
            expected = 0.0
            for index in group:
                distance = look_distance(person, places, index)
                if distance is not None:
                    unknown = max(SETTINGS.unknown_appearance, light_change(known, places, index))
                    expected += SETTINGS.appearance * (distance - unknown)
            assert cost == pytest.approx(expected)


def look_distance(person: GroundPerson, places: Places, index: int) -> float | None:
    """Return the distance of a detection's look to a person's in its camera; None: not known."""
    measurements = places.measurements
    template, look = person.template(int(measurements.camera[index])), measurements.histograms[index]
    if not len(template) or not len(look):
        return None
    return float(appearance_distance_matrix(template[None], look[None])[0, 0])


def light_change(known: list[GroundPerson], places: Places, index: int) -> float:
    """Return the median distance of the detections in a camera to whom they resemble most."""
    camera = places.measurements.camera
    found = [
        [look_distance(person, places, int(other)) for person in known]
        for other in np.flatnonzero(camera == camera[index])
    ]
    nearest = [min(each for each in row if each is not None) for row in found]
    return float(np.median(nearest))


def test_a_change_of_light_makes_nobody_unlike_themselves() -> None:
    random = np.random.default_rng(4)
    places = places_with_looks(random, 3)
    looks = places.measurements.histograms
    # What was seen in some colors is then seen in others that nobody had.
    bright = tuple(np.concatenate([each, np.zeros(len(each))]) for each in looks)
    dark = tuple(np.concatenate([np.zeros(len(each)), each]) for each in looks)
    before, after = (
        replace(places, measurements=replace(places.measurements, histograms=found))
        for found in (bright, dark)
    )
    known = [GroundPerson(k, 0, before, k, 0.04, SETTINGS) for k in range(3)]
    for k, person in enumerate(known):
        person.learn(before, k, usual_boxes(before.measurements, SIZES))
    assert appearance_costs(known, after, SETTINGS) == pytest.approx(0.0)
    assert (np.diag(appearance_costs(known, before, SETTINGS)[:, :3]) < 0.0).all()


def test_nobody_and_nothing_have_no_costs() -> None:
    random = np.random.default_rng(0)
    places, nothing = places_with_looks(random, 2), places_with_looks(random, 0)
    person = GroundPerson(1, 0, places, 0, 0.04, SETTINGS)
    assert appearance_costs([], places, SETTINGS).shape == (0, len(places))
    assert appearance_costs([person], nothing, SETTINGS).shape == (1, 0)


@few
@given(seeds)
def test_densities_are_those_of_the_normal_distribution(seed: int) -> None:
    random = np.random.default_rng(seed)
    roots = random.normal(size=(4, 2, 2)) + 0.1 * np.eye(2)
    covariances = roots @ np.swapaxes(roots, 1, 2) + 0.01 * np.eye(2)
    offsets = random.normal(size=(4, 2))
    densities = OffsetDensities.of(offsets, covariances)
    for row, (offset, covariance) in enumerate(zip(offsets, covariances, strict=True)):
        expected = multivariate_normal.logpdf(offset, cov=covariance)
        assert densities.costs[row] == pytest.approx(-expected)
        assert densities.distances[row] == pytest.approx(offset @ np.linalg.inv(covariance) @ offset)
