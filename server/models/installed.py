"""Where the installed networks are."""

from __future__ import annotations

import os
from pathlib import Path

from server.models.catalog import MODELS, InstallableModel
from server.system.errors import UserError

_FOLDER_VARIABLE = "MYVIEW_MODELS"


def models_folder() -> Path:
    """Return where networks are installed: ``$MYVIEW_MODELS``, or in the user's cache."""
    if folder := os.environ.get(_FOLDER_VARIABLE):
        return Path(folder)
    cache = os.environ.get("XDG_CACHE_HOME")
    return (Path(cache) if cache else Path.home() / ".cache") / "myview" / "models"


def network_path(model: InstallableModel) -> Path:
    """Return the ONNX file of an installed network, whether it exists or not."""
    return models_folder() / f"{model.name}.onnx"


def check_installed(path: Path) -> None:
    """Check that a network of the catalog is installed, if the path is that of one.

    Raises:
        UserError: it is not.
    """
    for model in MODELS:
        if path == network_path(model) and not path.exists():
            raise UserError(f"{model.name} is not installed: run `myview models install {model.name}`")


def is_installed(model: InstallableModel) -> bool:
    """Return whether a network is installed."""
    return network_path(model).exists()
