"""Comparison with other trackers on the same public detections: HOTA, MOTA, IDF1, identity switches.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.other_trackers --data ../shared/data --out out/bench

All run with their defaults, MyView as `myview track --det`. The other trackers are installed by pip into
their own environment in the user's cache; where that fails, only MyView is measured. Perfect association is
the upper bound: every detection gets the id of its person.
"""

from __future__ import annotations

from argparse import BooleanOptionalAction
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl

from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.public_detections import Recording, find_recordings, track
from benchmarks.common.report import Report
from benchmarks.other_trackers.plots import plot
from benchmarks.other_trackers.virtual_environment import (
    PACKAGES,
    PEERS,
    OtherTrackerEnvironment,
    OtherTrackersUnavailableError,
    default_folder,
    peer_environment,
)
from tracking.evaluation import HEADINGS, Scores, average_scores, format_scores, oracle_association
from tracking.motchallenge import MotRow, read_rows

_SHOWN = (
    "hota",
    "deta",
    "assa",
    "mota",
    "idf1",
    "recall",
    "precision",
    "switches",
    "tracks",
    "objects",
)
_HEADINGS = [HEADINGS[score] for score in _SHOWN]

OURS, PICTURES, CEILING = "MyView", "MyView, pictures", "perfect association"

Table = dict[str, dict[str, Scores]]
"""By sequence, then by tracker."""


def environment(folder: Path, report: Report) -> OtherTrackerEnvironment | None:
    """Return the environment of the other trackers; report why where it cannot be made."""
    try:
        return peer_environment(folder)
    except OtherTrackersUnavailableError as problem:
        report.line(f"without other trackers, which cannot be installed here: {problem}")
        return None


def tracks_of(
    sequence: Recording, peers: OtherTrackerEnvironment | None, report: Report, *, pictures: bool
) -> Iterator[tuple[str, list[MotRow]]]:
    """Yield each tracker's tracks of a sequence, MyView's first and perfect association's last."""
    yield OURS, track(sequence)
    if pictures and sequence.video is not None and sequence.video.is_file():
        yield PICTURES, track(sequence, pictures=True)
    if peers is not None:
        yield from _peers_tracks(sequence, peers, report)
    yield CEILING, oracle_association(read_rows(sequence.public_detections), read_rows(sequence.truth))


def _peers_tracks(
    sequence: Recording, peers: OtherTrackerEnvironment, report: Report
) -> Iterator[tuple[str, list[MotRow]]]:
    for peer in PEERS:
        try:
            yield peer.name, peers.track(peer, sequence.public_detections)
        except OtherTrackersUnavailableError as problem:
            report.line(f"{sequence.name}: without {peer.name}: {problem}")


def difference(
    peers: OtherTrackerEnvironment, sequence: Recording, tracks: list[MotRow], scores: Scores
) -> float:
    """Return the largest difference of the scores to those of a TrackEval port."""
    theirs = peers.score(read_rows(sequence.truth), tracks)
    return max(abs(float(getattr(scores, name)) - value) for name, value in theirs.items())


def lead(table: Table) -> list[list[str]]:
    """Return the differences to the best other tracker in each score."""
    rows = []
    names = [peer.name for peer in PEERS]
    for sequence, found in table.items():
        peers = [found[name] for name in names if name in found]
        if peers:
            ours = found[OURS]
            shares = [
                f"{100 * (getattr(ours, name) - max(getattr(peer, name) for peer in peers)):+.1f}"
                for name in ("hota", "mota", "idf1")
            ]
            rows.append([sequence, *shares, f"{ours.switches - min(peer.switches for peer in peers):+d}"])
    return rows


def run(options_data: Path, out: Path, folder: Path, names: list[str] | None, *, pictures: bool) -> None:
    """Measure, print and save."""
    sequences = find_recordings(options_data, names)
    report = Report()
    report.line(f"other trackers: {', '.join(PACKAGES)}, with their defaults")
    peers = environment(folder, report)
    table: Table = {}
    worst = 0.0
    for sequence in sequences:
        found = table[sequence.name] = {}
        for name, tracks in tracks_of(sequence, peers, report, pictures=pictures):
            scores = found[name] = sequence.score(tracks)
            if peers is not None:
                worst = max(worst, difference(peers, sequence, tracks, scores))
        report.table(
            sequence.name,
            ["", *_HEADINGS],
            [[name, *format_scores(scores, _SHOWN)] for name, scores in found.items()],
        )
    if len(table) > 1:
        everywhere = [name for name in table[sequences[0].name] if all(name in row for row in table.values())]
        averages = [
            [name, *format_scores(average_scores([row[name] for row in table.values()]), _SHOWN)]
            for name in everywhere
        ]
        report.table("mean over the sequences; counts are totals", ["", *_HEADINGS], averages)
    ahead = lead(table)
    if ahead:
        report.table(
            "MyView minus the best other tracker in each score", ["", "HOTA", "MOTA", "IDF1", "IDSW"], ahead
        )
        report.line(f"the TrackEval port differs from these scores by at most {worst:.1g}")
    report.save(out / "other_trackers.txt")
    plot(table, CEILING, out / "other_trackers.png")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "other_trackers")
    options.add_argument(
        "--environment", type=Path, default=default_folder(), help="folder of the other trackers' environment"
    )
    options.add_argument("--sequence", action="append", help="only this one; may be repeated")
    options.add_argument(
        "--pictures", action=BooleanOptionalAction, default=True, help="also MyView with the video, if any"
    )
    chosen = options.parse_args()
    mpl.use("Agg")
    try:
        run(chosen.data, chosen.out, chosen.environment, chosen.sequence, pictures=chosen.pictures)
    except CannotRunError as problem:
        finish(problem, "other_trackers")


if __name__ == "__main__":
    main()
