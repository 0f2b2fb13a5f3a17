"""Accuracy of calibration from walking people, and its effect on identities.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.calibration --data ../shared/data --out out/bench

In the synthetic room, the true cameras are known. In recordings, foot points of the same person, by the
ground truth, are compared between cameras. *Moved* is the joint IDF1 with the corners of the pictures moved
by half a pixel, which no calibration knows better: an exchange of two people that comes and goes is chance.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.bestview.association_baselines import own_tracks
from benchmarks.bestview.camera_tracks import track_scene
from benchmarks.bestview.scenes import recorded
from benchmarks.calibration.calibration_errors import (
    GroundAgreement,
    camera_overlaps,
    foot_point_errors,
    ground_agreements,
)
from benchmarks.calibration.joint_identities import joint_idf1
from benchmarks.common.detector_names import detector_names, detector_settings
from benchmarks.common.environment import CannotRunError, parser
from benchmarks.common.public_detections import Recording, track
from benchmarks.common.recorded_views import RecordedViews, find_views
from benchmarks.common.report import Report
from bestview.calibration import (
    CalibrationError,
    Walk,
    WalkCalibration,
    WalkSettings,
    WalkTrack,
    calibrate_from_walks,
)
from server.cli.calibrate.walk_input import VideoFormat, walks_from_tracks
from server.cli.track.command import track_one
from server.service.calibration.calibration_report import ground_file_text
from server.service.calibration.floor_plan import plot_floor_plan
from server.service.calibration.floor_plan_camera import floor_plan_cameras
from synthetic import Scene, write_recording
from tracking.motchallenge import write_rows

_PERSON_M = 1.75
_SHIFT_S = 3.0
_MOVED_RUNS = 4
_ROOM_S, _ROOM_SIZE, _ROOM_FPS = 60.0, (640, 360), 25.0
_FRAME_OFFSETS = {"c1": 7, "c2": -4}
"""Frames by which the room's cameras are desynchronized."""
_AUDITORIUM = ("HC3", "HC4", "IP2", "IP5")
_AUDITORIUM_FPS = 30.0


@dataclass(frozen=True, slots=True)
class RoomWalk:
    """A recorded walk in the synthetic room, and the true homographies of its cameras."""

    people: int
    truth: dict[str, np.ndarray]
    from_boxes: tuple[Walk, ...]
    from_tracks: tuple[Walk, ...]


def render_room(folder: Path, people: int) -> RoomWalk:
    """Render a minute of the synthetic room, and track it."""
    scene = Scene("room", 3, people, 1, *_ROOM_SIZE, _ROOM_FPS)
    write_recording(scene, folder, _ROOM_S, lambda _done, _total: None)
    tracks = _tracked(find_views(folder.parent, folder.name), folder / "tracked", None)
    video_format = VideoFormat(_ROOM_SIZE, _ROOM_FPS)
    matrices = json.loads((folder / "ground.json").read_text(encoding="ascii"))["homography"]
    return RoomWalk(
        people,
        {name: np.array(matrix) for name, matrix in matrices.items()},
        walks_from_tracks([folder / "gt"], video_format).walks,
        walks_from_tracks([tracks], video_format).walks,
    )


def _tracked(views: RecordedViews, out: Path, config: Path | None) -> Path:
    out.mkdir()
    for video in views.videos:
        track_one(video, None, out / f"{video.stem}.txt", config, None, lambda _: None)
    return out


def desynchronize(walk: Walk) -> Walk:
    """Shift a camera's tracks by its frame offset."""
    offset = _FRAME_OFFSETS.get(walk.camera, 0)
    return replace(
        walk, tracks=tuple(WalkTrack(track.first_frame - offset, track.boxes) for track in walk.tracks)
    )


def room_rows(report: Report, folder: Path, out: Path) -> None:
    """Compare the calibration with the true cameras of the synthetic room."""
    rows = []
    for people in (1, 4):
        room = render_room(folder / f"room{people}", people)
        for name, walks in (("true boxes", room.from_boxes), ("MyView's tracks", room.from_tracks)):
            found = calibrate_from_walks(
                [desynchronize(walk) for walk in walks], WalkSettings.at_rate(_ROOM_FPS, _SHIFT_S), _PERSON_M
            )
            errors = foot_point_errors(found, room.truth, [desynchronize(walk) for walk in walks])
            rows.append(
                [
                    f"{people} walking, {name}",
                    f"{found.floor_error.median:.2f}",
                    f"{np.median(errors):.2f}",
                    f"{np.quantile(errors, 0.9):.2f}",
                    *(
                        f"{camera.offset:+.1f} ± {2 * camera.offset_error:.1f}"
                        for camera in found.cameras[1:]
                    ),
                ]
            )
            _plot(found, out / f"calibration_room{people}_{name.split()[-1]}.png")
    heading = [
        "room, 60 s",
        "feet distance, heights",
        "error, m, median",
        "90 %",
        "offset c1 (+7)",
        "c2 (-4)",
    ]
    report.table("Against the room's true cameras (up to a rotation and a shift)", heading, rows)


def terrace_rows(report: Report, folder: Path, options: argparse.Namespace) -> None:
    """Compare with the published calibration, by foot points of people with known identities."""
    scene = recorded(options.data, "terrace").with_detector(detector_settings(options.detector))
    tracks, truth, size = folder / "terrace", options.data / "terrace" / "gt", scene.sizes["c0"]
    tracks.mkdir()
    uncalibrated = track_scene(scene.config(ground=False), scene.detect(ground=False).frames)
    for camera, own in own_tracks(uncalibrated).items():
        write_rows(tracks / f"{camera}.txt", own)
    walked = walks_from_tracks([tracks], VideoFormat(size, scene.content["site"]["fps"]))
    found = calibrate_from_walks(walked.walks, WalkSettings.at_rate(walked.fps, _SHIFT_S), _PERSON_M)
    _plot(found, options.out / "calibration_terrace.png")
    estimated = folder / "terrace.json"
    estimated.write_text(
        ground_file_text("m", {camera.camera: camera.homography for camera in found.cameras})
    )
    rows: list[list[str]] = []
    for name, ground in (("published", scene.content["ground"]), ("from MyView's tracks", str(estimated))):
        agreement = ground_agreements(Path(ground), truth, size)["c0", "c1"]
        calibrated = replace(scene, content={**scene.content, "ground": ground})
        joint = joint_idf1(calibrated, _MOVED_RUNS, folder)
        moved = ", ".join(f"{100 * idf1:.1f}" for idf1 in joint.moved)
        rows.append([name, *_cells(agreement), f"{100 * joint.given:.1f}", moved])
    heading = ["terrace", "feet distance, heights", "90 %", "nearest correct, %", "joint IDF1", "moved"]
    title = f"Against the published calibration, at the true boxes; two views, detector {options.detector}"
    report.table(title, heading, rows)
    offsets = ", ".join(
        f"{camera.camera} {camera.offset:+.1f} ± {2 * camera.offset_error:.1f}" for camera in found.cameras
    )
    report.line(f"terrace: offsets in frames: {offsets}")


def auditorium_rows(report: Report, folder: Path, options: argparse.Namespace) -> None:
    """Calibrate from public detections of many simultaneous people."""
    tracks, source = folder / "auditorium", options.data / "auditorium"
    if not source.is_dir():
        raise CannotRunError(f"needs {source}")
    size = (1920, 1080)
    overlaps = camera_overlaps(source / "gt", _AUDITORIUM, size)
    report.table(
        "auditorium, true boxes of a person in two cameras at the same time",
        ["cameras", "people", "boxes", "distance from a fitted plane, box heights"],
        [
            [
                f"{one}, {other}",
                str(overlap.people),
                str(overlap.boxes),
                f"{overlap.residual:.2f}" if overlap.boxes else "-",
            ]
            for (one, other), overlap in overlaps.items()
        ],
    )
    tracks.mkdir()
    for camera in _AUDITORIUM:
        detected, truth = (source / kind / f"{camera}.txt.gz" for kind in ("det", "gt"))
        recording = Recording(camera, detected, truth, _AUDITORIUM_FPS)
        write_rows(tracks / f"{camera}.txt", track(recording))
    walked = walks_from_tracks([tracks], VideoFormat(size, _AUDITORIUM_FPS))
    found = calibrate_from_walks(walked.walks, WalkSettings.at_rate(walked.fps, 0.0), _PERSON_M)
    _plot(found, options.out / "calibration_auditorium.png")
    ground = folder / "auditorium.json"
    ground.write_text(ground_file_text("m", {camera.camera: camera.homography for camera in found.cameras}))
    rows = [
        [f"{one}, {other}", *_cells(agreement)]
        for (one, other), agreement in ground_agreements(ground, source / "gt", size).items()
    ]
    report.table(
        "auditorium, at the true boxes",
        ["cameras", "feet distance, heights", "90 %", "nearest correct, %"],
        rows,
    )
    for uncalibrated in found.uncalibrated:
        report.line(f"auditorium: {uncalibrated.camera} is not calibrated: {uncalibrated.reason}")


def _cells(agreement: GroundAgreement) -> Sequence[str]:
    return [f"{agreement.median:.2f}", f"{agreement.p90:.2f}", f"{100 * agreement.nearest_correct:.0f}"]


def _plot(found: WalkCalibration, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    plot_floor_plan(floor_plan_cameras(found), "m", path)


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "calibration")
    options.add_argument(
        "--detector",
        default="background",
        choices=detector_names(),
        help="of terrace: a kind, an installed network, or both: fused+nanodet",
    )
    options.add_argument(
        "--scene", action="append", choices=("room", *_RECORDED), help="only this one; may be repeated"
    )
    chosen = options.parse_args()
    selected, report = chosen.scene or ("room", *_RECORDED), Report()
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work)
        if "room" in selected:
            room_rows(report, folder, chosen.out)
        for name, rows in _RECORDED.items():
            if name in selected:
                try:
                    rows(report, folder, chosen)
                except (CannotRunError, CalibrationError) as problem:
                    report.line(f"{name}: skipped: {problem}")
    report.save(chosen.out / "calibration.txt")


_RECORDED = {"terrace": terrace_rows, "auditorium": auditorium_rows}


if __name__ == "__main__":
    main()
