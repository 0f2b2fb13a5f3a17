"""The command `areas`: divides a site between best-view services by where its cameras look."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from server.system.errors import UserError
from server.system.log_setup import log_to_stderr

if TYPE_CHECKING:
    from server.config.site_config import Config

_MARGIN_M = 5.0
"""Three seconds of walking: for as long, people are known to both areas."""


def areas(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="The site's configuration, a YAML file.")],
    of: Annotated[int, typer.Option("--of", min=2, max=64, help="How many best-view services.")] = 2,
) -> None:
    """Print how best-view services can divide a site by area: the setting view.sharding."""
    import numpy as np
    import yaml

    from bestview import FloorAreas
    from server.config.ground_unit import UNITS_PER_METER
    from server.config.loader import load_config
    from server.supervisor.synthetic_homographies import add_synthetic_homographies

    log_to_stderr("areas")
    site = add_synthetic_homographies(load_config(config))
    homographies = {
        camera.id: None if camera.ground is None else np.array(camera.ground, dtype=np.float64)
        for camera in site.cameras
    }
    sizes = {camera: _picture_size(site, camera) for camera, at in homographies.items() if at is not None}
    try:
        divided = FloorAreas(homographies, sizes, of)
    except ValueError as error:
        raise UserError(f"{config}: {error}") from error
    units = {UNITS_PER_METER.get(camera.ground_unit or "") for camera in site.cameras if camera.ground}
    unit = units.pop() if len(units) == 1 else None
    sharding = {
        "of": of,
        "areas": [
            {
                "cameras": list(divided.cameras_of(area)),
                "also": list(divided.also_seen_by(area)),
                "floor": [round(edge, 3) for edge in divided.floor_of(area)],
                "margin": _MARGIN_M * (unit or 1.0),
            }
            for area in range(of)
        ],
    }
    if unit is None:
        typer.echo(
            "# margin: in units of the ground, which are not known: as far as people walk in 3 seconds"
        )
    typer.echo(
        yaml.safe_dump({"view": {"sharding": sharding}}, sort_keys=False, default_flow_style=None).rstrip()
    )


def _picture_size(site: Config, camera: str) -> tuple[int, int]:
    """Return width and height of a camera's own pictures, to which its homography refers.

    Raises:
        UserError: its source cannot be opened.
    """
    from server.camera.sources import open_source
    from server.config.camera_password import fill_in_password

    source = open_source(fill_in_password(site, camera).camera(camera), site.site, warm_up=False)
    try:
        return source.size
    finally:
        source.close()
