"""A person who walks from one site into another keeps their number; no two people have the same one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bestview import (
    IdentityRegistry,
    IdentitySettings,
    IdentityUpdate,
    IdSeries,
    Person,
    SiteSighting,
)
from bestview.association.affinity.travel_times import CameraSighting
from bestview.association.appearance.histograms import (
    HistogramEqualizer,
    MeanHistogram,
    PersonAppearance,
)
from bestview.association.registry.other_sites import ReferenceHistograms
from fakes.bestview.identity_scenes import (
    BLIND,
    STRIDE,
    StraightTrack,
    coat,
    persons_by_track,
    updates,
)

_EVERY = 5
"""Updates between two exchanges: a second."""
_UNSEEN = 10
"""Frames after which a person has left."""
BINS = 64


class Site:
    """A site's registry, and its people as they walk."""

    def __init__(self, name: str, index: int, walks: Sequence[StraightTrack], frames: int) -> None:
        self.name = name
        settings = IdentitySettings()
        self.registry = IdentityRegistry(settings, BLIND, ids=IdSeries(index, 2))
        self.updates: list[IdentityUpdate] = []
        self.walking = updates(self.registry, walks, frames)

    @property
    def people(self) -> dict[tuple[str, int], int]:
        return persons_by_track(self.updates)

    def visible(self, now: int) -> set[int]:
        return {
            person.person_id
            for person in self.registry.people
            if not person.elsewhere and person.last_frame == now
        }

    def tell(self, other: Site, now: int, *, with_histograms: bool = True) -> None:
        own = [person for person in self.registry.people if not person.elsewhere]
        histograms = (
            self.registry.mean_histograms([person.person_id for person in own]) if with_histograms else {}
        )
        sightings = [
            SiteSighting(
                person.person_id,
                self.name,
                person.camera,
                person.last_frame,
                person.last_frame >= now - _UNSEEN,
                histograms.get(person.person_id),
            )
            for person in own
        ]
        other.registry.add_site_sightings(sightings, {self.name: self.registry.reference_histogram(BINS)})


def walk_between(
    hall: Sequence[StraightTrack],
    yard: Sequence[StraightTrack],
    frames: int = 700,
    *,
    with_histograms: bool = True,
) -> tuple[Site, Site]:
    """Let people walk in two sites that tell each other once a second."""
    sites = Site("hall", 0, hall, frames), Site("yard", 1, yard, frames)
    for count, pair in enumerate(zip(*(site.walking for site in sites), strict=True), 1):
        for site, update in zip(sites, pair, strict=True):
            site.updates.append(update)
        if count % _EVERY == 0:
            sites[0].tell(sites[1], count * STRIDE - 1, with_histograms=with_histograms)
            sites[1].tell(sites[0], count * STRIDE - 1, with_histograms=with_histograms)
        visible = [site.visible(count * STRIDE - 1) for site in sites]
        assert visible[0].isdisjoint(visible[1])
    return sites


def stay(local: int, which: float, start: int, end: int, camera: str = "south") -> StraightTrack:
    """Return somebody who is seen from one frame to another, and whose looks are these."""
    return StraightTrack(camera, local, start, end, (-4.0 + 2.0 * local, 0.0), coat=which)


COATS = (1.0, 2.0, 3.0, 4.0)


@pytest.mark.parametrize("travel", [40, 200], ids=["next door", "around the corner"])
def test_people_who_walk_from_one_site_into_the_other_keep_their_numbers(travel: int) -> None:
    hall, yard = walk_between(
        [stay(n, which, 30 * n, 150 + 40 * n) for n, which in enumerate(COATS)],
        [stay(n, which, 150 + 40 * n + travel, 690) for n, which in enumerate(COATS)],
    )
    assert sorted(hall.people.values()) == [1, 3, 5, 7]
    assert yard.people == hall.people


def test_strangers_get_new_numbers_of_their_own_site() -> None:
    hall, yard = walk_between(
        [stay(n, which, 0, 150) for n, which in enumerate(COATS)],
        [stay(0, 5.0, 200, 690), stay(1, 6.0, 240, 690), stay(2, 2.0, 280, 690)],
    )
    assert yard.people["south", 0] == 2
    assert yard.people["south", 1] == 4
    assert yard.people["south", 2] == hall.people["south", 1]


def test_a_stranger_who_looks_like_two_of_the_people_who_left_gets_a_new_number() -> None:
    hall, yard = walk_between([stay(0, 1.0, 0, 150), stay(1, 1.2, 0, 150)], [stay(0, 1.1, 220, 690)])
    assert len(hall.people) == 2
    assert yard.people == {("south", 0): 2}


def test_nobody_is_somebody_whom_another_site_sees() -> None:
    hall, yard = walk_between([stay(0, 1.0, 0, 690)], [stay(0, 1.0, 200, 690)])
    assert (hall.people["south", 0], yard.people["south", 0]) == (1, 2)


def test_who_returns_still_has_their_number() -> None:
    hall, yard = walk_between(
        [stay(0, 1.0, 0, 150), stay(1, 3.0, 0, 150), stay(2, 1.0, 460, 690)],
        [stay(0, 1.0, 220, 400), stay(1, 4.0, 220, 690)],
    )
    assert yard.people == {("south", 0): 1, ("south", 1): 2}
    assert hall.people["south", 2] == hall.people["south", 0] == 1


def test_a_site_that_does_not_tell_looks_gives_nobody_their_number() -> None:
    hall, yard = walk_between([stay(0, 1.0, 0, 150)], [stay(0, 1.0, 220, 690)], with_histograms=False)
    assert (hall.people["south", 0], yard.people["south", 0]) == (1, 2)


def test_a_site_that_renders_everybody_brighter_is_equalized_once_both_have_seen_many() -> None:
    crowd, brighter = np.linspace(1.0, 5.0, 200), 1.0
    walker = MeanHistogram.of(coat(3.2 + brighter), 25)
    here, hall = HistogramEqualizer(), ReferenceHistograms()
    new, old = PersonAppearance({"c0": walker}), {"hall": MeanHistogram.of(coat(3.2), 25)}
    before = hall.distances(here, [new], [old])[0, 0]
    for which in crowd:
        here.learn("c0", coat(which + brighter))
    assert hall.distances(here, [new], [old])[0, 0] == before, "the hall has told nothing yet"
    hall.put("hall", np.sum([coat(which) for which in crowd], axis=0))
    stranger = {"hall": MeanHistogram.of(coat(3.2 + brighter), 25)}
    distances = hall.distances(here, [new, PersonAppearance()], [old, stranger, {}])
    gate = IdentitySettings().appearance_gate
    assert before > gate
    assert distances[0, 0] < gate / 2 < gate < distances[0, 1]
    assert np.isnan(distances[1]).all()
    assert np.isnan(distances[0, 2])


def test_travel_times_between_sites_tell_people_with_similar_looks_apart() -> None:
    """Those who walk over take 60 frames; of two who look nearly alike the one who left then arrives."""
    settings = replace(IdentitySettings(), appearance_gate_share=4.0)
    registry = IdentityRegistry(settings, BLIND, ids=IdSeries(1, 2))
    learned = [
        (100 * n, SiteSighting(2 * n + 1, "hall", "exit", 100 * n, is_visible=False, histogram=None))
        for n in range(12)
    ]
    arrivals = [stay(n, 1.0 + n / 2, left + 60, left + 90) for n, (left, _) in enumerate(learned)]
    late, old = 2000, 1400
    arrivals.append(stay(50, 1.55, late + 60, late + 150))
    for count, _ in enumerate(updates(registry, arrivals, late + 150), 1):
        now = count * STRIDE - 1
        for n, (left, sighting) in enumerate(learned):
            if now == left + 4:
                registry.add_site_sightings([replace(sighting, histogram=histogram_of(1.0 + n / 2))], {})
        if now == late + 4:
            registry.add_site_sightings(
                [
                    SiteSighting(101, "hall", "exit", late, is_visible=False, histogram=histogram_of(1.5)),
                    SiteSighting(103, "hall", "exit", old, is_visible=False, histogram=histogram_of(1.6)),
                ],
                {},
            )
    assert {person.person_id for person in registry.people if person.camera == "south"} >= {101}
    assert next(person for person in registry.people if person.person_id == 103).elsewhere


def histogram_of(which: float) -> MeanHistogram:
    """Return somebody's mean histogram after a second."""
    return MeanHistogram.of(coat(which), 25)


@given(st.integers(1, 8), st.integers(0, 10**9))
def test_series_share_no_id_and_leave_none_out(step: int, least: int) -> None:
    series = [IdSeries(index, step) for index in range(step)]
    firsts = [each.first_from(least) for each in series]
    assert sorted(firsts) == list(range(max(least, 1), max(least, 1) + step))
    assert all(each.has(first) for each, first in zip(series, firsts, strict=True))
    assert sum(each.has(max(least, 1)) for each in series) == 1


def test_ids_of_other_sites_do_not_raise_the_own_ones() -> None:
    registry = IdentityRegistry(IdentitySettings(), BLIND, ids=IdSeries(0, 2))
    registry.add_site_sightings([SiteSighting(10**8, "yard", "c0", 0, is_visible=False)], {})
    registry.forget([10**8])
    assert registry.next_id == 1
    registry.reserve_below(8)
    assert registry.next_id == 9


@pytest.mark.parametrize("is_newer", [True, False])
def test_merging_somebody_elsewhere_brings_no_camera_of_another_site(*, is_newer: bool) -> None:
    here, gone = Person(1, 50, "south"), Person(2)
    gone.add_site_sighting(SiteSighting(2, "yard", "c0", 90 if is_newer else 10, is_visible=False))
    here.merge(gone)
    assert here.last_sighting == CameraSighting("south", 50)
    assert not here.elsewhere
