"""Clustering in batches of linked rows equals clustering all rows at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import IdentitySettings
from bestview.association.affinity.affinity_matrix import AffinityMatrix
from bestview.association.affinity.candidate_links import CandidateLinks, split_into_batches
from bestview.association.affinity.evidence import PairEvidence
from bestview.association.appearance.histograms import MeanHistogram, PersonAppearance
from bestview.association.appearance.likelihood import (
    AppearanceWeights,
    CameraAppearances,
    DistanceScale,
    appearance_evidence,
    bhattacharyya_distances,
)
from bestview.association.clustering import cluster
from bestview.association.registry.person import Person
from bestview.association.tracklet import Tracklet, TrackletEndpoint, TrackletKey

CAMERAS = {"c0": True, "c1": True, "c2": False}
SETTINGS = IdentitySettings(crowd_s=0.04, appearance_s=0.32).resolve(25.0)
WEIGHTS = AppearanceWeights(
    SETTINGS.appearance_evidence, SETTINGS.maximum_appearance_evidence, SETTINGS.appearance_frames
)
HEIGHT, FRAMES, COATS = 1.8, 100, 4
WALKING_SPEED = 0.06


@dataclass(frozen=True)
class Site:
    """Tracklets and people at some time, and the evidence about them."""

    tracklets: list[Tracklet]
    people: list[Person]
    affinity: AffinityMatrix

    @property
    def appearance(self) -> list[CameraAppearances]:
        """Mean histograms of all rows, camera by camera."""
        found = []
        for camera in CAMERAS:
            every = [tracklet.appearance for tracklet in self.tracklets] + [
                person.appearance for person in self.people
            ]
            histograms = [
                (row, appearance.by_camera[camera])
                for row, appearance in enumerate(every)
                if camera in appearance.by_camera
            ]
            if histograms:
                rows = np.array([row for row, _ in histograms], dtype=np.int64)
                total = np.array([histogram.histogram_sum for _, histogram in histograms])
                count = np.array([float(histogram.frame_count) for _, histogram in histograms])
                found.append(CameraAppearances(rows, total, count, DistanceScale(0.1, 0.3)))
        return found


def draw_appearance(rng: np.random.Generator, coat: np.ndarray, camera: str) -> PersonAppearance:
    appearance = PersonAppearance()
    if rng.random() < 0.8:
        appearance.add(
            camera, MeanHistogram.of(coat * rng.uniform(0.7, 1.3, coat.size), int(rng.integers(1, 12)))
        )
    return appearance


@st.composite
def sites(draw: st.DrawFn) -> Site:
    """Draw a site whose people are seen by several cameras one after the other."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    coats = rng.dirichlet(np.full(8, 0.5), COATS)
    places = rng.uniform(0, draw(st.sampled_from([3.0, 30.0])), (COATS, 2))
    tracklets: list[Tracklet] = []
    for local in range(draw(st.integers(0, 14))):
        coat, camera = int(rng.integers(COATS)), str(rng.choice(list(CAMERAS)))
        first = int(rng.integers(0, FRAMES - 20))
        ends = []
        for frame in (first, first + int(rng.integers(0, 20))):
            ground = places[coat] + rng.normal(0, 0.3, 2) if CAMERAS[camera] else np.full(2, np.nan)
            ends.append(TrackletEndpoint(frame, rng.uniform(0, 300, 4), ground))
        before = next((tracklet for tracklet in tracklets[::-1] if tracklet.key.camera == camera), None)
        if before is not None and (before.end.frame >= first or rng.random() < 0.5):
            before = None
        appearance = draw_appearance(rng, coats[coat], camera)
        published = {coat + 1: 5} if rng.random() < 0.4 else {}
        key = TrackletKey(camera, local, first)
        tracklets.append(
            Tracklet(key, ends[0], ends[1], before, appearance=appearance, published_frames=published)
        )
    people = [Person(number + 1, settled_frames=5) for number in range(draw(st.integers(0, COATS)))]
    for person in people:
        for camera in CAMERAS:
            person.appearance.add_all(draw_appearance(rng, coats[person.person_id - 1], camera))
    affinity = AffinityMatrix(SETTINGS)
    affinity.set_rows([*(tracklet.key for tracklet in tracklets), *(person.person_id for person in people)])
    rows = len(affinity)
    one, two = np.triu_indices(rows, 1)
    apart, met, alike = (rng.random(one.size) < share for share in (0.1, 0.3, 0.2))
    affinity.add_cannot_links(one[apart], two[apart])
    score, frames = rng.normal(2, 20, one.size), np.full(one.size, 5)
    affinity.add_ground_evidence(one[met], two[met], score[met], frames[met])
    affinity.add_localized_frames(
        rng.integers(0, rows, 40 * bool(rows)), rng.integers(0, FRAMES, 40 * bool(rows))
    )
    affinity.add_appearance_evidence(one[alike], two[alike], rng.normal(0, 1, int(alike.sum())))
    return Site(tracklets, people, affinity)


def reference_links_and_clusters(site: Site, unseen: np.ndarray) -> tuple[set[tuple[int, int]], list[int]]:
    """Compute links and clusters from full matrices."""
    rows, count = len(site.affinity), len(site.tracklets)
    evidence = PairEvidence(
        site.tracklets, site.people, site.affinity, CAMERAS, SETTINGS, HEIGHT, WALKING_SPEED
    )
    one, two = np.triu_indices(rows, 1)
    value, apart = (np.zeros((rows, rows), dtype=kind) for kind in (np.float64, np.bool_))
    value[one, two], apart[one, two] = evidence.of(one, two)
    value, apart = value + value.T, apart | apart.T
    alike = np.zeros((rows, rows))
    for camera in site.appearance:
        mean = camera.histogram_sum / camera.frame_count[:, None]
        distance = bhattacharyya_distances(mean, mean)
        alike[np.ix_(camera.rows, camera.rows)] += appearance_evidence(
            distance, camera.frame_count[:, None], camera.frame_count, camera.scale, WEIGHTS
        )
    is_open = np.arange(rows) < count
    linked = (value + alike > 0) & ~apart & (is_open[:, None] | is_open) & ~np.eye(rows, dtype=np.bool_)
    label = cluster(value, apart, unseen, linked, site.appearance, WEIGHTS, SETTINGS.merge_threshold)
    return {(int(i), int(j)) for i, j in zip(*np.nonzero(np.triu(linked)), strict=True)}, label.tolist()


@settings(deadline=None, max_examples=150)
@given(sites(), st.integers(0, 2**32))
def test_clustering_in_batches_equals_clustering_all_rows_at_once(site: Site, seed: int) -> None:
    rows, count = len(site.affinity), len(site.tracklets)
    unseen = (np.arange(rows) >= count) & (np.random.default_rng(seed).random(rows) < 0.7)
    links, groups = reference_links_and_clusters(site, unseen)
    evidence = PairEvidence(
        site.tracklets, site.people, site.affinity, CAMERAS, SETTINGS, HEIGHT, WALKING_SPEED
    )
    found = CandidateLinks.find(evidence, site.appearance, WEIGHTS, count, rows)
    assert set(zip(found.first.tolist(), found.second.tolist(), strict=True)) == links
    assert len(found.first) == len(links)
    label = np.arange(rows)
    for batch in split_into_batches(found, evidence, site.appearance, minimum_rows=3):
        labels = cluster(
            batch.evidence,
            batch.cannot_link,
            unseen[batch.rows],
            batch.linked,
            batch.appearance,
            WEIGHTS,
            SETTINGS.merge_threshold,
        )
        label[batch.rows] = batch.rows[labels]
    assert label.tolist() == groups


@settings(deadline=None, max_examples=50)
@given(sites())
def test_pair_evidence_does_not_depend_on_other_pairs(site: Site) -> None:
    evidence = PairEvidence(
        site.tracklets, site.people, site.affinity, CAMERAS, SETTINGS, HEIGHT, WALKING_SPEED
    )
    one, two = np.triu_indices(len(site.affinity), 1)
    value, apart = evidence.of(one, two)
    for pair in range(one.size):
        alone, alone_apart = evidence.of(one[[pair]], two[[pair]])
        assert (alone[0], alone_apart[0]) == (value[pair], apart[pair])
