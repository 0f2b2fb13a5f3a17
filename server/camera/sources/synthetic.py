"""A synthetic scene as a frame source: ``scene:room?camera=0&cameras=3&objects=4&seed=1``."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from urllib.parse import parse_qsl

from server.camera.sources.base import Image
from server.config.sections import SiteSettings
from server.system.errors import UserError
from synthetic import Scene

_WHOLE_NUMBER = re.compile(r"[0-9]{1,18}")
_DEFAULTS = {"camera": 0, "cameras": None, "objects": None, "seed": 1}  # None: the scene's default


class SyntheticSource:
    """Draws the image of a pulse; endless.

    Raises:
        UserError: the scene is unknown, or its parameters are wrong.
    """

    recorded = True

    def __init__(self, source: str, site: SiteSettings) -> None:
        name, _, query = source.removeprefix("scene:").partition("?")
        values: dict[str, int | None] = dict(_DEFAULTS)
        for key, value in parse_qsl(query, keep_blank_values=True):
            if key not in values or not _WHOLE_NUMBER.fullmatch(value):
                raise UserError(
                    f"{source}: {key}={value} must be a whole number, for one of {', '.join(values)}"
                )
            values[key] = int(value)
        camera, seed = values["camera"] or 0, values["seed"] or 0
        size = (site.width, site.height)
        try:
            self._scene = Scene(name, values["cameras"], values["objects"], seed, *size, site.fps)
        except ValueError as error:
            raise UserError(f"{source}: {error}") from error
        if camera >= self._scene.cameras:
            raise UserError(
                f"{source}: there is no camera {camera}: the scene has {self._scene.cameras}, numbered from 0"
            )
        self._camera = camera
        self.size = size

    def warm_up(self) -> None:
        """Draw one image: painting the room takes a second, which must not delay the first pulse."""
        self._scene.image(self._camera, 0)

    def take(self, pulse: int) -> Image | None:
        """Draw the image of a pulse."""
        return self._scene.image(self._camera, pulse)

    def prescan_images(self, pulses: Sequence[int]) -> Iterator[Image]:
        """Draw the images of some pulses."""
        return (self._scene.image(self._camera, pulse) for pulse in pulses)

    @property
    def ground(self) -> list[list[float]] | None:
        """The homography from the image to the floor in meters, as in a configuration; None: no floor."""
        homography = self._scene.homography(self._camera)
        return None if homography is None else [[float(entry) for entry in row] for row in homography]

    def close(self) -> None:
        """Nothing to close."""
