"""The command that finds out where the cameras' floor is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from server.wire.errors import UserError


def calibrate(
    given: Annotated[list[Path], typer.Argument(metavar="POINTS", help="Marked points (JSON or CSV).")],
    out: Annotated[Path, typer.Option("--out", help="The file to write, for `ground:` and --ground.")],
    plan: Annotated[
        Path | None, typer.Option("--plan", help="A picture of the floor plan; OUT.png by default.")
    ] = None,
    unit: Annotated[str | None, typer.Option("--unit", help="What the floor is measured in.")] = None,
) -> None:
    """Find each camera's homography to the floor."""
    from server.run.calibrate import calibrate_points
    from server.run.calibrate_points import ENDINGS

    plan = plan or out.with_suffix(".png")
    if len(given) != 1 or given[0].suffix.lower() not in ENDINGS:
        raise UserError("calibrate: name one file of marked points, .json or .csv")
    for line in calibrate_points(given[0], out, plan, unit):
        typer.echo(line)
    typer.echo(f"{out}: homographies; {plan}: the floor plan")
