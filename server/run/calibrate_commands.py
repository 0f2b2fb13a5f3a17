"""The command that finds out where the cameras' floor is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from server.wire.errors import UserError


def calibrate(
    given: Annotated[
        list[Path],
        typer.Argument(
            metavar="INPUT…", help="Marked points (JSON or CSV), or tracks of each camera, or videos."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="The file to write, for `ground:` and --ground.")],
    plan: Annotated[
        Path | None, typer.Option("--plan", help="A picture of the floor plan; OUT.png by default.")
    ] = None,
    unit: Annotated[str | None, typer.Option("--unit", help="Of marked points: the floor's unit.")] = None,
    config: Annotated[Path | None, typer.Option("--config", help="Of videos: settings for tracking.")] = None,
    size: Annotated[str | None, typer.Option("--size", help="Of tracks: WIDTHxHEIGHT in pixels.")] = None,
    fps: Annotated[
        float | None, typer.Option("--fps", min=1.0, help="Frames a second; 25 of tracks.")
    ] = None,
    shift: Annotated[
        float, typer.Option("--shift", min=0.0, help="Seconds that cameras may be out of step.")
    ] = 3.0,
    person: Annotated[float, typer.Option("--person", min=0.1, help="How tall people are, metres.")] = 1.75,
    force: Annotated[bool, typer.Option("--force", help="Write even if the walk covered little.")] = False,
) -> None:
    """Find each camera's homography to the floor: from marked points, or from people who walk about."""
    from server.run.calibrate import calibrate_from_walks, calibrate_points
    from server.run.calibrate_points import ENDINGS
    from server.run.calibrate_tracks import (
        Picture,
        is_tracks,
        walk_settings,
        walks_from_tracks,
        walks_from_videos,
    )

    for path in given:
        if not path.exists():
            raise UserError(f"{path}: is not there")
    plan = plan or out.with_suffix(".png")
    if plan.resolve() == out.resolve():
        raise UserError(f"--out: {out}: the floor plan would be written there too; name a .json, or --plan")
    if any(path.suffix.lower() in ENDINGS for path in given):
        if len(given) > 1:
            raise UserError("calibrate: marked points are one file, with all cameras in it")
        lines = calibrate_points(given[0], out, plan, unit)
    else:
        picture = Picture(_size(size), fps)
        if all(is_tracks(path) for path in given):
            walked = walks_from_tracks(given, picture)
        else:
            walked = walks_from_videos(
                given, config, picture, lambda name: typer.echo(f"tracking {name}", err=True)
            )
        settings = walk_settings(walked.fps, shift)
        lines = calibrate_from_walks(walked, out, plan, settings, person, force=force)
    for line in lines:
        typer.echo(line)
    typer.echo(f"{out}: homographies; {plan}: the floor plan")


def _size(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise UserError(f"--size: {text!r} is not WIDTHxHEIGHT, such as 640x360")
    return int(width), int(height)
