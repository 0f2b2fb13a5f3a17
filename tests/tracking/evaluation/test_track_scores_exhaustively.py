"""Scores of small random cases equal those of all possible matchings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import permutations

import numpy as np
import pytest

from tracking.evaluation import evaluate
from tracking.evaluation.frame_matching import FrameSimilarity, align_frames
from tracking.motchallenge import MotRow

CASES = 60
MIN_IOU = 0.5
ALPHAS = np.arange(1, 20) / 20.0
Pairs = list[tuple[int, int]]


def random_rows(rng: np.random.Generator, objects: int) -> list[MotRow]:
    """Draw up to `objects` people in a space two boxes wide, for five frames."""
    return [
        MotRow(frame, number, rng.uniform(0, 60), rng.uniform(0, 60), 80.0, 160.0)
        for frame in range(1, 6)
        for number in range(1, objects + 1)
        if rng.random() < 0.8
    ]


def matchings(frame: FrameSimilarity) -> Iterator[Pairs]:
    """Yield all maximal matchings."""
    people, tracks = frame.similarity.shape
    if people <= tracks:
        for columns in permutations(range(tracks), people):
            yield list(zip(range(people), columns, strict=True))
    else:
        for rows in permutations(range(people), tracks):
            yield list(zip(rows, range(tracks), strict=True))


def ids(frame: FrameSimilarity, pairs: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    return [(int(frame.truth[row]), int(frame.tracks[column])) for row, column in pairs]


def boxes_of(frames: list[FrameSimilarity]) -> tuple[dict[int, int], dict[int, int]]:
    """Count each person's and each track's boxes."""
    people: dict[int, int] = {}
    tracks: dict[int, int] = {}
    for frame in frames:
        for number in frame.truth.tolist():
            people[number] = people.get(number, 0) + 1
        for number in frame.tracks.tolist():
            tracks[number] = tracks.get(number, 0) + 1
    return people, tracks


def clear(frames: list[FrameSimilarity]) -> tuple[int, int]:
    """Return matches and switches: pairs are kept where possible, then the overlap is maximal."""
    matches = switches = 0
    before: dict[int, int] = {}
    last: dict[int, int] = {}
    for frame in frames:
        if not frame.similarity.size:
            continue
        best: tuple[float, ...] = (-1.0, 0.0)
        chosen: Pairs = []
        for pairs in matchings(frame):
            kept = [pair for pair in pairs if frame.similarity[pair] >= MIN_IOU]
            stays = sum(before.get(person) == track for person, track in ids(frame, kept))
            rank = (float(stays), float(sum(frame.similarity[pair] for pair in kept)))
            if rank > best:
                best, chosen = rank, kept
        before = dict(ids(frame, chosen))
        matches += len(chosen)
        switches += sum(last.get(person, track) != track for person, track in before.items())
        last |= before
    return matches, switches


def identity_f1(frames: list[FrameSimilarity]) -> float:
    """Return IDF1 by the best assignment of tracks to people."""
    people, tracks = boxes_of(frames)
    together = {
        (person, track): sum(
            frame.similarity[row, column] >= MIN_IOU
            for frame in frames
            for row in np.flatnonzero(frame.truth == person)
            for column in np.flatnonzero(frame.tracks == track)
        )
        for person in people
        for track in tracks
    }
    names = [*tracks, *[None] * len(people)]
    best = max(
        sum(together.get((person, track), 0) for person, track in zip(people, chosen, strict=True))  # type: ignore[arg-type]
        for chosen in permutations(names, len(people))
    )
    return float(2 * best / (sum(people.values()) + sum(tracks.values())))


def hota(frames: list[FrameSimilarity]) -> float:
    """Return HOTA by its paper's definition: matched by the best alignment over the recording."""
    people, tracks = boxes_of(frames)
    shared = dict.fromkeys(((person, track) for person in people for track in tracks), 0.0)
    for frame in frames:
        overlap = frame.similarity
        total = overlap.sum(axis=0)[None] + overlap.sum(axis=1)[:, None] - overlap
        for row, column in np.argwhere(overlap > 0.0).tolist():
            pair = ids(frame, [(row, column)])[0]
            shared[pair] += float(overlap[row, column] / total[row, column])
    aligned = {(p, t): both / (people[p] + tracks[t] - both) for (p, t), both in shared.items()}
    chosen = [
        max(
            matchings(frame),
            key=lambda pairs, frame=frame: sum(  # type: ignore[misc]
                aligned[pair] * frame.similarity[cell]
                for cell, pair in zip(pairs, ids(frame, pairs), strict=True)
            ),
        )
        for frame in frames
    ]
    return float(np.mean([_hota_at(alpha, frames, chosen, people, tracks) for alpha in ALPHAS]))


def _hota_at(
    alpha: float,
    frames: list[FrameSimilarity],
    chosen: list[Pairs],
    people: dict[int, int],
    tracks: dict[int, int],
) -> float:
    found = [
        pair
        for frame, pairs in zip(frames, chosen, strict=True)
        for pair in ids(frame, (cell for cell in pairs if frame.similarity[cell] >= alpha))
    ]
    union = sum(people.values()) + sum(tracks.values()) - len(found)
    alike = 0.0
    for person, track in set(found):
        count = found.count((person, track))
        alike += count * count / (people[person] + tracks[track] - count)
    return float(np.sqrt(alike / union))


@pytest.mark.parametrize("seed", range(CASES))
def test_scores_equal_those_of_exhaustive_search(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth, tracks = random_rows(rng, 3), random_rows(rng, int(rng.integers(1, 5)))
    frames = align_frames(truth, tracks, MIN_IOU)
    scores = evaluate(truth, tracks)
    matches, switches = clear(frames)
    assert (scores.misses, scores.false_positives) == (len(truth) - matches, len(tracks) - matches)
    assert scores.switches == switches
    assert scores.mota == pytest.approx(1 - (len(truth) + len(tracks) - 2 * matches + switches) / len(truth))
    assert scores.idf1 == pytest.approx(identity_f1(frames))
    assert scores.hota == pytest.approx(hota(frames))
