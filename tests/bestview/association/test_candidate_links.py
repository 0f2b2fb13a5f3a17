"""Grouping by chains of links gives what grouping everybody with everybody at once would."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import IdentitySettings
from bestview.association.affinity.affinity_matrix import PairTables
from bestview.association.affinity.candidate_links import Links, batches
from bestview.association.affinity.evidence import Evidence
from bestview.association.appearance.likelihood import (
    CameraLooks,
    LookScale,
    LookWeights,
    look_distances,
    look_evidence,
)
from bestview.association.appearance.mean_histograms import Look, Looks
from bestview.association.clustering import cluster
from bestview.association.keys import EpisodeKey
from bestview.association.registry.person import Person
from bestview.association.tracklet import End, Episode

CAMERAS = {"c0": True, "c1": True, "c2": False}
SETTINGS = IdentitySettings(crowd_frames=1)
WEIGHTS = LookWeights(
    SETTINGS.appearance_evidence, SETTINGS.maximum_appearance_evidence, SETTINGS.appearance_frames
)
HEIGHT, FRAMES, COATS = 1.8, 100, 4
PACE = 0.06


@dataclass(frozen=True)
class Site:
    """Episodes and people as they may be at some time, and what is known of them."""

    episodes: list[Episode]
    past: list[Person]
    tables: PairTables

    @property
    def looks(self) -> list[CameraLooks]:
        """How everybody looks, camera by camera."""
        found = []
        for camera in CAMERAS:
            every = [it.looks for it in self.episodes] + [it.looks for it in self.past]
            mine = [(row, it.by_camera[camera]) for row, it in enumerate(every) if camera in it.by_camera]
            if mine:
                rows = np.array([row for row, _ in mine], dtype=np.int64)
                total = np.array([look.total for _, look in mine])
                count = np.array([float(look.count) for _, look in mine])
                found.append(CameraLooks(rows, total, count, LookScale(0.1, 0.3)))
        return found


def looks_of(rng: np.random.Generator, coat: np.ndarray, camera: str) -> Looks:
    looks = Looks()
    if rng.random() < 0.8:
        looks.add(camera, Look.of(coat * rng.uniform(0.7, 1.3, coat.size), int(rng.integers(1, 12))))
    return looks


@st.composite
def sites(draw: st.DrawFn) -> Site:
    """Draw one in which some people walk about, seen by several cameras one after the other."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    coats = rng.dirichlet(np.full(8, 0.5), COATS)
    places = rng.uniform(0, draw(st.sampled_from([3.0, 30.0])), (COATS, 2))
    episodes: list[Episode] = []
    for local in range(draw(st.integers(0, 14))):
        who, camera = int(rng.integers(COATS)), str(rng.choice(list(CAMERAS)))
        first = int(rng.integers(0, FRAMES - 20))
        ends = []
        for frame in (first, first + int(rng.integers(0, 20))):
            ground = places[who] + rng.normal(0, 0.3, 2) if CAMERAS[camera] else np.full(2, np.nan)
            ends.append(End(frame, rng.uniform(0, 300, 4), ground))
        before = next((it for it in episodes[::-1] if it.key.camera == camera), None)
        if before is not None and (before.end.frame >= first or rng.random() < 0.5):
            before = None
        looks = looks_of(rng, coats[who], camera)
        told = {who + 1: 5} if rng.random() < 0.4 else {}
        key = EpisodeKey(camera, local, first)
        episodes.append(Episode(key, ends[0], ends[1], before, looks=looks, told=told))
    past = [Person(number + 1, settled=5) for number in range(draw(st.integers(0, COATS)))]
    for person in past:
        for camera in CAMERAS:
            person.looks.add_all(looks_of(rng, coats[person.number - 1], camera))
    tables = PairTables(SETTINGS)
    tables.arrange([*(it.key for it in episodes), *(it.number for it in past)])
    rows = len(tables)
    one, two = np.triu_indices(rows, 1)
    apart, met, alike = (rng.random(one.size) < share for share in (0.1, 0.3, 0.2))
    tables.add_apart(one[apart], two[apart])
    score, frames = rng.normal(2, 20, one.size), np.full(one.size, 5)
    tables.add_near(one[met], two[met], score[met], frames[met])
    tables.stand(rng.integers(0, rows, 40 * bool(rows)), rng.integers(0, FRAMES, 40 * bool(rows)))
    tables.add_alike(one[alike], two[alike], rng.normal(0, 1, int(alike.sum())))
    return Site(episodes, past, tables)


def plainly(site: Site, gone: np.ndarray) -> tuple[set[tuple[int, int]], list[int]]:
    """Links and groups with tables of everybody and everybody."""
    rows, count = len(site.tables), len(site.episodes)
    evidence = Evidence(site.episodes, site.past, site.tables, CAMERAS, SETTINGS, HEIGHT, PACE)
    one, two = np.triu_indices(rows, 1)
    value, apart = (np.zeros((rows, rows), dtype=kind) for kind in (np.float64, np.bool_))
    value[one, two], apart[one, two] = evidence.of(one, two)
    value, apart = value + value.T, apart | apart.T
    alike = np.zeros((rows, rows))
    for camera in site.looks:
        mean = camera.total / camera.count[:, None]
        distance = look_distances(mean, mean)
        alike[np.ix_(camera.rows, camera.rows)] += look_evidence(
            distance, camera.count[:, None], camera.count, camera.scale, WEIGHTS
        )
    is_open = np.arange(rows) < count
    linked = (value + alike > 0) & ~apart & (is_open[:, None] | is_open) & ~np.eye(rows, dtype=np.bool_)
    label = cluster(value, apart, gone, linked, site.looks, WEIGHTS, SETTINGS.merge_threshold)
    return {(int(i), int(j)) for i, j in zip(*np.nonzero(np.triu(linked)), strict=True)}, label.tolist()


@settings(deadline=None, max_examples=150)
@given(sites(), st.integers(0, 2**32))
def test_chains_of_links_give_the_groups_of_everybody_at_once(site: Site, seed: int) -> None:
    rows, count = len(site.tables), len(site.episodes)
    gone = (np.arange(rows) >= count) & (np.random.default_rng(seed).random(rows) < 0.7)
    links, groups = plainly(site, gone)
    evidence = Evidence(site.episodes, site.past, site.tables, CAMERAS, SETTINGS, HEIGHT, PACE)
    found = Links.found(evidence, site.looks, WEIGHTS, count, rows)
    assert set(zip(found.one.tolist(), found.two.tolist(), strict=True)) == links
    assert len(found.one) == len(links)
    label = np.arange(rows)
    for batch in batches(found, evidence, site.looks, least=3):
        own = cluster(
            batch.evidence,
            batch.apart,
            gone[batch.rows],
            batch.linked,
            batch.looks,
            WEIGHTS,
            SETTINGS.merge_threshold,
        )
        label[batch.rows] = batch.rows[own]
    assert label.tolist() == groups


@settings(deadline=None, max_examples=50)
@given(sites())
def test_what_is_known_of_a_pair_does_not_hang_on_the_others(site: Site) -> None:
    evidence = Evidence(site.episodes, site.past, site.tables, CAMERAS, SETTINGS, HEIGHT, PACE)
    one, two = np.triu_indices(len(site.tables), 1)
    value, apart = evidence.of(one, two)
    for pair in range(one.size):
        alone, alone_apart = evidence.of(one[[pair]], two[[pair]])
        assert (alone[0], alone_apart[0]) == (value[pair], apart[pair])
