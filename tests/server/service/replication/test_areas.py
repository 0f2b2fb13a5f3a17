"""Services that divide a site by area know the same people as one that has all of it."""

from __future__ import annotations

import pytest

from benchmarks.scaling.divided_hall import agreement, divide, observe, run_divided
from benchmarks.scaling.simulated_hall import SimulatedHall


@pytest.fixture(scope="module")
def hall() -> SimulatedHall:
    """A hall of 16 cameras, with six people in each view."""
    return SimulatedHall(16, 6)


@pytest.mark.parametrize("services", [2, 4, 8])
def test_services_know_the_same_people_as_one(hall: SimulatedHall, services: int) -> None:
    observed = observe(hall, 50)
    whole, divided = run_divided(hall, observed, 1), run_divided(hall, observed, services)
    assert agreement(whole.numbers[-1], divided.numbers[-1]) == 1.0
    assert len(whole.numbers[-1]) == len(divided.numbers[-1])
    assert divided.changes <= whole.changes + 1
    people = len(set(observed[-1].people.values()))
    assert divided.doubled <= 0.02 * people * len(observed)


def test_areas_divide_a_halls_cameras(hall: SimulatedHall) -> None:
    areas = divide(hall, 4)
    assert sorted(camera for area in areas for camera in area["cameras"]) == hall.ids
    assert all(not set(area["cameras"]) & set(area["also"]) for area in areas)
