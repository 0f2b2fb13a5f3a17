"""The command ``calibrate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from server.system.address_redaction import redact_to_host
from server.system.atomic_write import atomic_file
from server.system.errors import UserError


def calibrate(
    inputs: Annotated[
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
        float | None, typer.Option("--fps", min=1.0, max=1000.0, help="Frames a second; 25 of tracks.")
    ] = None,
    shift: Annotated[
        float,
        typer.Option("--shift", min=0.0, max=60.0, help="Largest time offset between cameras, seconds."),
    ] = 3.0,
    person_height: Annotated[
        float, typer.Option("--person", min=0.1, max=1000.0, help="People's height, meters.")
    ] = 1.75,
    force: Annotated[
        bool, typer.Option("--force", help="Write even if the walk covered too little.")
    ] = False,
) -> None:
    """Calibrate cameras to the floor: from marked points, or from people who walk about."""
    from bestview.calibration import WalkSettings
    from server.cli.calibrate.calibration import calibrate_from_walks, calibrate_points
    from server.cli.calibrate.walk_input import VideoFormat, read_walks
    from server.cli.render.video_info import parse_size
    from server.service.calibration.points_file import ENDINGS

    for path in inputs:
        if not path.exists():
            raise UserError(f"{redact_to_host(str(path))}: does not exist")
    plan = plan or out.with_suffix(".png")
    if plan.resolve() == out.resolve():
        raise UserError(f"--out: {out}: the floor plan would be written there too; name a .json, or --plan")
    picture = VideoFormat(parse_size(size) if size else None, fps)
    with atomic_file(out, *inputs) as ground, atomic_file(plan, *inputs) as drawn:  # both files or none
        if any(path.suffix.lower() in ENDINGS for path in inputs):
            if len(inputs) > 1:
                raise UserError("calibrate: marked points are one file, with all cameras in it")
            lines = calibrate_points(inputs[0], ground, drawn, unit)
        else:
            walked = read_walks(
                inputs, config, picture, lambda name: typer.echo(f"tracking {name}", err=True)
            )
            settings = WalkSettings.at_rate(walked.fps, shift)
            lines = calibrate_from_walks(walked, ground, drawn, settings, person_height, force=force)
    for line in lines:
        typer.echo(line)
    typer.echo(f"{out}: homographies; {plan}: the floor plan")
