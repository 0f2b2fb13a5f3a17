"""Commands that read and write files: render, track, evaluate and scene.

Each imports its modules when it runs, so that a process loads no more than it needs.
"""

from __future__ import annotations

import logging
from datetime import datetime
from pathlib import Path
from typing import Annotated
from zoneinfo import ZoneInfo

import typer

from server.system.atomic_write import atomic_folder
from server.system.errors import UserError

OutFolder = Annotated[Path, typer.Option("--out", help="A new folder to write into.")]


def render(
    videos: Annotated[list[Path], typer.Argument(metavar="VIDEO…", help="Recorded views, one each.")],
    out: OutFolder,
    config: Annotated[Path | None, typer.Option("--config", help="Settings, and cameras by name.")] = None,
    det: Annotated[
        list[Path] | None,
        typer.Option(
            "--det",
            metavar="FILE",
            help="Detections (MOTChallenge) instead of a detector; once per view, in order.",
        ),
    ] = None,
    ground: Annotated[Path | None, typer.Option("--ground", help="Homographies (JSON) per view.")] = None,
    begins: Annotated[
        datetime | None,
        typer.Option(
            formats=["%Y-%m-%dT%H:%M:%S%z", "%Y-%m-%dT%H:%M:%S", "%Y-%m-%dT%H:%M"],
            help="When the views begin, for rules with a schedule; in the site's time zone.",
        ),
    ] = None,
) -> None:
    """Render the best view of each person in recorded views: videos, tracks, choices and plots."""
    from server.cli.generated_config import config_for_videos
    from server.cli.progress import bar, total_frames
    from server.cli.render.renderer import render as render_views
    from server.config.loader import read_content

    logging.basicConfig(format="%(message)s", level=logging.WARNING)
    base = read_content(config) if config else {}
    loaded = config_for_videos(
        videos,
        base=base,
        where=str(config or "myview render"),
        folder=config.parent if config else Path(),
        ground=ground,
        detections=det or [],
    )
    if begins is not None and begins.tzinfo is None and loaded.site.time_zone is not None:
        begins = begins.replace(tzinfo=ZoneInfo(loaded.site.time_zone))
    with atomic_folder(out) as folder, bar("frames") as progress:
        task = progress.add_task("rendering", total=total_frames(videos, loaded.site.fps))
        people = render_views(
            loaded,
            folder,
            lambda done: progress.update(task, completed=done),
            None if begins is None else begins.timestamp(),
        )
    numbers = ", ".join(map(str, people.numbers)) or "none"
    typer.echo(
        f"{out}: best views of {len(people.numbers)} people ({numbers}), tracks, choices.csv and plots"
    )
    if people.corrected:
        corrected = ", ".join(f"{number} is {kept}" for number, kept in people.corrected.items())
        typer.echo(f"numbers that turned out to be others' (corrections.csv): {corrected}")


def track(
    out: Annotated[Path, typer.Option("--out", help="The file to write: MOTChallenge text.")],
    video: Annotated[Path | None, typer.Argument(metavar="[VIDEO]", help="Not needed with --det.")] = None,
    det: Annotated[Path | None, typer.Option("--det", help="Detections, MOTChallenge text.")] = None,
    tracker: Annotated[str | None, typer.Option(help="Tracker; lp is MyView's network flow program.")] = None,
    solver: Annotated[str | None, typer.Option(help="Solver of the network flow program.")] = None,
    config: Annotated[Path | None, typer.Option("--config", help="Settings of detector and tracker.")] = None,
    template: Annotated[
        list[str] | None,
        typer.Option(metavar="LEFT,TOP,WIDTH,HEIGHT", help="Follow this box of the first picture."),
    ] = None,
) -> None:
    """Track people in a video or in detections, or the objects shown by --template."""
    if template:
        if tracker is not None:
            raise UserError("--template: has its own tracker; leave --tracker out")
        _track_templates(out, video, det, solver, config, template)
        return
    from server.cli.progress import bar, total_frames
    from server.cli.track.command import track_one

    with bar("frames") as progress:
        task = progress.add_task("tracking", total=total_frames([video]) if video else None)
        count = track_one(
            video,
            det,
            out,
            config,
            solver,
            lambda done: progress.update(task, completed=done),
            tracker,
        )
    typer.echo(f"{out}: {count} people")


def _track_templates(
    out: Path, video: Path | None, det: Path | None, solver: str | None, config: Path | None, boxes: list[str]
) -> None:
    from server.cli.progress import bar, total_frames
    from server.cli.track.templates import boxes_from, track_templates

    if video is None or det is not None:
        raise UserError("--template: needs a video, and no --det")
    templates = boxes_from(boxes)
    with bar("frames") as progress:
        task = progress.add_task("tracking", total=total_frames([video]))
        count = track_templates(
            video, templates, out, config, solver, lambda done: progress.update(task, completed=done)
        )
    typer.echo(f"{out}: {count} objects")


def evaluate(
    truth: Annotated[
        list[Path],
        typer.Option(
            "--gt",
            metavar="PATH",
            help="Ground truth: a file, once per camera, or a folder of one file per camera.",
        ),
    ],
    tracks: Annotated[
        list[Path] | None,
        typer.Option("--tracks", metavar="PATH", help="Tracks: as many files, or such a folder."),
    ] = None,
    views: Annotated[Path | None, typer.Option("--views", help="Choices of views: choices.csv.")] = None,
    videos: Annotated[
        list[Path] | None,
        typer.Option("--videos", metavar="FILE", help="A view's video for --plots; once per camera."),
    ] = None,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT of the cameras' pictures.")] = None,
    fps: Annotated[float | None, typer.Option(min=0.01, max=1000.0, help="Frames per second.")] = None,
    switch_cost: Annotated[
        float | None,
        typer.Option(min=0.0, max=3600.0, help="Seconds of not seeing a person that a cut is worth."),
    ] = None,
    visible: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Visible share from which a view shows a person.")
    ] = 0.25,
    iou: Annotated[
        float, typer.Option(min=0.01, max=1.0, help="Overlap (IoU) from which a box matches a person.")
    ] = 0.5,
    json_file: Annotated[Path | None, typer.Option("--json", help="A JSON file for the scores.")] = None,
    plots: Annotated[
        Path | None, typer.Option("--plots", help="A new folder for plots of the choices.")
    ] = None,
) -> None:
    """Score tracks (HOTA, MOTA, IDF1, identity switches) and choices of views against ground truth."""
    from server.cli.evaluate.command import EvaluateOptions
    from server.cli.evaluate.command import evaluate as score
    from server.cli.evaluate.site_info import SiteOptions

    site = SiteOptions(size, fps, switch_cost)
    score(EvaluateOptions(truth, tracks or [], views, videos or [], site, iou, visible, json_file, plots))


def scene(
    name: Annotated[str, typer.Argument(metavar="NAME", help="room, gallery, overhead, court or fish.")],
    out: OutFolder,
    cameras: Annotated[
        int | None, typer.Option(min=1, show_default="the scene's default", help="Number of cameras.")
    ] = None,
    objects: Annotated[
        int | None, typer.Option(min=1, show_default="the scene's default", help="Number of people, or fish.")
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.04, max=86400.0)] = 20.0,
    seed: Annotated[int, typer.Option(min=0)] = 1,
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT in pixels.")] = "640x360",
    fps: Annotated[float, typer.Option(min=1.0, max=240.0)] = 25.0,
) -> None:
    """Write a synthetic multi-view recording with ground truth.

    room: people come and go. gallery: cameras without a floor in common. overhead: people meet and part, seen
    from straight above. court: two teams play. fish: nine that look the same, in a murky tank.
    """
    from server.cli.progress import bar
    from server.cli.render.video_info import parse_size
    from server.system.atomic_write import atomic_folder
    from synthetic import Scene, has_ground, write_recording

    try:
        drawn = Scene(name, cameras, objects, seed, *parse_size(size), fps)
        with atomic_folder(out) as draft, bar("frames") as progress:
            task = progress.add_task("drawing", total=None)
            write_recording(
                drawn, draft, seconds, lambda done, total: progress.update(task, completed=done, total=total)
            )
    except (ValueError, OSError) as error:
        raise UserError(str(error)) from error
    views = "1 view" if drawn.cameras == 1 else f"{drawn.cameras} views"
    typer.echo(f"{out}: {views}, gt/{' and ground.json' if has_ground(drawn) else ''}")
