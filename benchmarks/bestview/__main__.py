"""Who is who across cameras, and the best view of everybody, beside simpler ways and beside the truth.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.bestview --data ../shared/data --out out/bench

Joint IDF1 takes all cameras as one recording, in which a number is one person everywhere. The choices are
scored as `myview evaluate --views` does, beside the exact offline optimum of what could really be seen.

The truth stands in for MyView's stages, one after the other; what is lost between two rows is that stage's:
*true boxes* of those who are visible; *own boxes, true ids*: those that MyView's cameras tracked, each with
the number of the person it is at, and the same with short gaps bridged; *own parts, true joins*: each part of
a track that identity takes for one person's, with the number of the person it is mostly at; *own tracks, true
joins*: the same of whole tracks; *again*: all as MyView numbered it at last, known at once, and
nobody ever away. The mean of *own tracks, not joined* is what each camera's tracker is worth by itself.

Recordings are looked at ahead, as MyView does with recordings; `--as-live` has them learned as they go.

*Looks alone* are those of sites whose cameras have no floor in common, told without travel times.

*Found only* leaves out views of people whom a camera does not find though others know where they stand. *No
evidence* is without what the cameras tell each other about each frame. *Calibrated* has the homographies
that `myview calibrate` makes of the cameras' own tracks. *Largest* chooses frame by frame the camera with the
largest box. *Nearest feet* joins whole tracks of our cameras, each by itself (or of ByteTrack, on the same
boxes), by the median distance of their feet, and chooses so, too. *Occupancy map* finds everybody on the
ground from all cameras' foreground and joins places by the flow of least cost; its views are chosen by
MyView's program. The sweeps are on true boxes.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2

from benchmarks.bestview.association_baselines import own_tracks
from benchmarks.bestview.camera_tracks import SceneDetections, followed
from benchmarks.bestview.identity_errors import MatchedBoxes
from benchmarks.bestview.methods import LEAST_IOU, MethodResult, MethodScores, SearchedScene, outcome, ways
from benchmarks.bestview.parameter_sweep import SweepResult, sweep, sweep_tables
from benchmarks.bestview.plots import plot_sweeps, plot_ways
from benchmarks.bestview.scenes import BenchmarkScene, auditorium, gallery, room, terrace
from benchmarks.bestview.track_calibration import CannotCalibrateError, calibrated
from benchmarks.bestview.visibility_losses import VisibilityLosses, losses
from benchmarks.common.environment import CannotRunError, parser
from benchmarks.common.report import Report
from benchmarks.other_trackers.virtual_environment import (
    OtherTrackerEnvironment,
    OtherTrackersUnavailableError,
    default_folder,
    peer_environment,
)

ROOMS = ((2, 3, 40.0), (4, 8, 40.0), (8, 20, 30.0))
"""Cameras, people, seconds."""
QUICK_ROOMS = ((2, 3, 12.0),)
SCENES = ("terrace", "auditorium", "room", "gallery")
ONE_ROOM = tuple(f"room-{cameras}-{people}" for cameras, people, _ in ROOMS)
GALLERY, QUICK_GALLERY = (6, 240.0), (3, 30.0)
"""People, seconds."""
COLUMNS = ["", "joint", "mean", "Agree", "Regret", "Visible", "Chosen", "Cuts", "Best", "Shot"]

LATER_S = (1.0, 15.0)
"""Seconds after which cameras are compared with themselves."""
WHO = ["", "whole", "pure", *(word for it in LATER_S for word in (f"{it:g} s: whole", "pure"))]
WHY = ["", "Visible", "choice", "number", "missed"]


def cases(options: argparse.Namespace, folder: Path, report: Report) -> Iterator[BenchmarkScene]:
    """Yield the scenes one after the other; those that are not there are said."""
    wanted = options.scene or SCENES
    for name, find in (("terrace", terrace), ("auditorium", auditorium)):
        if name in wanted:
            try:
                yield find(options.data)
            except CannotRunError as problem:
                report.say(f"{name}: left out: {problem}")
    for cameras, people, seconds in QUICK_ROOMS if options.quick else ROOMS:
        if "room" in wanted or f"room-{cameras}-{people}" in wanted:
            yield room(folder, cameras, people, seconds)
    if "gallery" in wanted:
        yield gallery(folder, *(QUICK_GALLERY if options.quick else GALLERY))


def as_live(case: BenchmarkScene) -> BenchmarkScene:
    """Return the scene as cameras would show it: nothing is known of it before its first frame."""
    return replace(case, content={**case.content, "detect": {"prescan_frames": 0}})


def row_of(it: MethodScores) -> list[str]:
    """Return a row of the table: percent, cuts a minute, and the shortest shot in frames."""
    idf1 = (
        ["", ""] if it.tracks is None else [f"{100 * s.idf1:.1f}" for s in (it.tracks.joint, it.tracks.mean)]
    )
    views = it.views
    shares = (views.agreement, views.regret, views.visible, views.chosen)
    cuts = (views.cuts_per_minute, views.optimum_cuts_per_minute)
    return [
        it.name,
        *idf1,
        *(f"{100 * share:.1f}" for share in shares),
        *(f"{it:.1f}" for it in cuts),
        str(views.shortest_shot or "-"),
    ]


def losses_of(name: str, it: VisibilityLosses) -> list[str]:
    """Return a row of the other table, percent."""
    return [name, *(f"{100 * share:.1f}" for share in (it.visible, it.choice, it.number, it.missed))]


def agreements_of(case: BenchmarkScene, way: MethodResult) -> list[str]:
    """Return a row of the table of who is who, percent."""
    met = MatchedBoxes.of(way.rendering.tracks, case.gt, LEAST_IOU)
    fps = float(case.content["site"]["fps"])
    told = (met.at_once(), *(met.later(round(seconds * fps)) for seconds in LATER_S))
    return [way.name, *(f"{100 * share:.1f}" for it in told for share in (it.whole, it.pure))]


def peers_of(options: argparse.Namespace, report: Report) -> OtherTrackerEnvironment | None:
    """Return the other trackers' environment, or say why there is none."""
    if options.no_peers or options.quick:
        return None
    try:
        return peer_environment(default_folder())
    except OtherTrackersUnavailableError as problem:
        report.say(f"without other trackers, which cannot be installed here: {problem}")
        return None


def walked_of(
    case: BenchmarkScene, blind: SceneDetections, folder: Path, report: Report
) -> SearchedScene | None:
    """Return the scene calibrated by its own tracks, or say why it cannot be."""
    try:
        walked = calibrated(case, own_tracks(followed(case.config(ground=False), blind.frames)), folder)
        return SearchedScene(walked, walked.watch())
    except CannotCalibrateError as problem:
        report.say(f"{case.name}: not calibrated by its own tracks: {problem}")
        return None


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    cv2.setNumThreads(1)
    report = Report()
    peers = peers_of(options, report)
    found: dict[str, list[MethodScores]] = {}
    swept: dict[str, list[SweepResult]] = {}
    with tempfile.TemporaryDirectory(prefix="myview-bestview-") as name:
        for found_case in cases(options, Path(name), report):
            case = as_live(found_case) if options.as_live else found_case
            truth = case.truth()
            seen = case.watch()
            blind = case.watch(ground=False) if case.calibrated else seen
            walked = None if options.quick else walked_of(case, blind, Path(name), report)
            tried = list(ways(case, truth, seen, blind, peers, walked))
            found[case.name] = [outcome(case, truth, way) for way in tried]
            report.table(f"{case.name}: {case.about}", COLUMNS, [row_of(it) for it in found[case.name]])
            who = [agreements_of(case, way) for way in tried if not way.given]
            report.table(f"{case.name}: who is who, at once and later", WHO, who)
            why = [(way.name, losses(case, truth, way)) for way in tried if not way.given]
            report.table(f"{case.name}: why not visible", WHY, [losses_of(name, it) for name, it in why])
            if not options.no_sweeps:
                swept[case.name] = sweep(case, truth, quick=options.quick)
    report.say("joint, mean: IDF1. Cuts, Best: a minute, the choice's and the optimum's. Shot: frames.")
    report.say(
        "Who is who: of pairs of boxes at one person, in two cameras at once or in one camera so long after, "
        "those that have one number are whole; of pairs of one number those at one person are pure."
    )
    report.say(
        "Not visible in the chosen view, though in some: by choice, their number was at them in a camera "
        "that shows them; by number, only others were; missed, none was."
    )
    sweep_tables(report, swept)
    report.save(options.out / "bestview.txt")
    plot_ways(found, options.out / "bestview.png")
    if swept:
        plot_sweeps(swept, options.out / "bestview_sweeps.png")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "bestview")
    options.add_argument(
        "--scene", action="append", choices=SCENES + ONE_ROOM, help="only this one; may be repeated"
    )
    options.add_argument("--as-live", action="store_true", help="recordings are not looked at ahead")
    options.add_argument("--quick", action="store_true", help="short synthetic scenes, no other trackers")
    options.add_argument("--no-peers", action="store_true", help="leave out the other tracker")
    options.add_argument(
        "--no-sweeps", action="store_true", help="leave out look-ahead, cost of a cut and GOP"
    )
    measure(options.parse_args())


if __name__ == "__main__":
    main()
