"""Commands that set a site up, or run it or one of its processes: init, demo, up, sync, camera and bestview.

Each imports its modules when it runs, so that a process loads no more than it needs.
"""

from __future__ import annotations

import os
from collections.abc import Coroutine
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from server.supervisor.shutdown import run_process
from server.system.atomic_write import check_output_folder
from server.system.errors import UserError
from server.system.log_setup import log_to_stderr

if TYPE_CHECKING:
    from server.config.running_config import ActiveConfig

ConfigPath = Annotated[Path, typer.Argument(metavar="CONFIG", help="The site's configuration, a YAML file.")]
_DEFAULT_CONFIG = Path("site.yaml")
_UP_RELEASE_S = 1.9
"""Longer than the release time of child processes."""
LogFolder = Annotated[
    Path | None, typer.Option("--out", help="Write tracks and camera choices into this new folder.")
]


def _read(config: Path) -> ActiveConfig:
    """Read a process's configuration; from then on SIGHUP reloads it.

    Raises:
        UserError: it cannot be read or is invalid.
    """
    from server.config.running_config import ActiveConfig
    from server.supervisor.sighup import record_early_sighups

    record_early_sighups()
    return ActiveConfig(config)


def sync(config: ConfigPath) -> None:
    """Send frame pulses over TCP: one process of a site."""
    from server.supervisor.sync_process import sync_process

    log_to_stderr("sync")
    running = _read(config)
    run_process(lambda: sync_process(running))


def camera(
    config: ConfigPath, camera_id: Annotated[str, typer.Argument(metavar="ID", help="Which camera.")]
) -> None:
    """Run one camera: take, encode, track, publish: one process of a site."""
    from server.supervisor.camera_process import camera_process
    from server.system.niceness import lower_own_priority

    log_to_stderr(camera_id)
    running = _read(config)
    if camera_id not in running.now.camera_ids:
        raise UserError(
            f"{config}: there is no camera {camera_id!r}; there are {', '.join(running.now.camera_ids)}"
        )

    def run() -> Coroutine[Any, Any, None]:
        lower_own_priority(running.now.site.niceness)  # no effect under a supervisor, which has done so
        return camera_process(running, camera_id)

    run_process(run)


def bestview(config: ConfigPath, out: LogFolder = None) -> None:
    """Choose, splice and serve: the page, the streams and the API of a site."""
    from server.supervisor.bestview_process import bestview_process

    log_to_stderr("bestview")
    running = _read(config)
    if out is not None:
        check_output_folder(out)
    run_process(lambda: bestview_process(running, out))


def rtsp(config: ConfigPath) -> None:
    """Serve the streams by RTSP: one process of a site."""
    from server.supervisor.rtsp_process import rtsp_process

    log_to_stderr("rtsp")
    running = _read(config)
    run_process(lambda: rtsp_process(running))


def up(
    config: Annotated[
        Path | None,
        typer.Argument(metavar="[CONFIG]", help="The site's configuration; site.yaml, if there is one."),
    ] = None,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="HTTP port, instead of the configuration's.")
    ] = None,
    out: LogFolder = None,
    setup: Annotated[
        bool, typer.Option("--setup", help="First set the site up in a browser, even if it has a file.")
    ] = False,
) -> None:
    """Run a whole site on this machine: every process, watched and restarted.

    Without a configuration, the site is first set up in a browser.
    """
    from server.supervisor.rtsp_process import check_gateway_installed
    from server.supervisor.site import check_exposure, run_up
    from server.supervisor.startup_checks import check_ports, check_sources_open

    log_to_stderr("up")
    path = _DEFAULT_CONFIG if config is None else config
    if setup or (config is None and not path.exists()):
        from server.cli.setup_page import set_up_in_page

        port = set_up_in_page(path, port)
    environment = {} if port is None else {"MYVIEW_HTTP__PORT": str(port)}
    os.environ.update(environment)
    running = _read(path)
    if out is not None:
        check_output_folder(out)
    check_exposure(running.now)
    check_ports(running.now)
    if running.now.rtsp.enabled:
        check_gateway_installed(running.now)
    check_sources_open(running.now)
    run_process(lambda: run_up(running, environment, out), release_s=_UP_RELEASE_S)


def init(
    config: Annotated[
        Path, typer.Argument(metavar="[CONFIG]", help="The file to write; an earlier one is kept beside it.")
    ] = _DEFAULT_CONFIG,
    search: Annotated[
        float, typer.Option(min=0, max=60, help="Seconds to search for cameras; 0: only addresses.")
    ] = 3.0,
) -> None:
    """Set a site up: find cameras or take addresses, try each, and write the configuration."""
    from server.cli.setup_dialog import run_setup_dialog

    run_setup_dialog(config, search)


def demo(
    port: Annotated[int | None, typer.Option(min=0, max=65535, help="HTTP port; 8080 if it is free.")] = None,
    seconds: Annotated[float | None, typer.Option(min=0, help="Stop after this many seconds.")] = None,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Do not open a browser.")] = False,
) -> None:
    """Show the system at work on an embedded synthetic scene."""
    from server.cli.demo import run_demo

    log_to_stderr("demo")
    run_process(
        lambda: run_demo(port, seconds, open_browser=not no_browser),
        release_s=_UP_RELEASE_S,
        end_on_sighup=True,
    )
