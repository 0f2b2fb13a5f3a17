"""The world of the scene `fish`: a tank. x runs east, y away from the first camera, z up, in meters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats, PinholeCamera, Viewpoint
from synthetic.drawing.figure import Figure, paste
from synthetic.ground_truth import CameraTruth, FigureLayer, measure_visibility
from synthetic.tank.fish import draw_fish, fish_vertices
from synthetic.tank.seabed import Seabed
from synthetic.tank.shoal import Shoal
from synthetic.tank.water import caustics
from synthetic.tank.weeds import Weeds
from synthetic.world import Bytes, SceneParameters

_EXTENT = (6.0, 5.0)  # meters
VIEWPOINTS = (
    Viewpoint((3.0, -4.4, 1.55), (3.0, 2.5, 1.28), 60.0),
    Viewpoint((10.1, 2.5, 1.55), (3.0, 2.5, 1.28), 60.0),
)


@dataclass(frozen=True, slots=True)
class _Moment:
    """All figures in front of a camera at a moment, farthest first."""

    lit: Bytes  # (H, W, 3) the bed
    layers: tuple[tuple[int | None, Figure], ...]  # a fish's number, None for weeds and rocks
    distance: Floats  # (P,) meters from the camera to every fish


class TankWorld:
    """Fish of identical appearance in a lit, murky tank."""

    def __init__(self, parameters: SceneParameters) -> None:
        self._views = [PinholeCamera.at(view, parameters.width, parameters.height) for view in VIEWPOINTS]
        self._weeds = [Weeds(view) for view in self._views]
        self._shoal = Shoal(parameters.objects, parameters.seed)
        self._bed = lru_cache(maxsize=None)(self._create_bed)
        # A recording needs the image and the ground truth of a frame: it is drawn once for both.
        self._moment = lru_cache(maxsize=parameters.cameras)(self._draw)

    @property
    def extent(self) -> tuple[float, float]:
        """The inner size of the tank."""
        return _EXTENT

    def picture(self, camera: int, seconds: float) -> Bytes:
        """Return the image of the tank with all fish."""
        moment = self._moment(camera, seconds)
        return self._paint(camera, moment.lit, moment.layers)

    def background(self, camera: int, seconds: float) -> Bytes:
        """Return the image of the tank without fish."""
        lit = self._bed(camera).lit(seconds)
        still = self._still(camera, lit, seconds)
        return self._paint(camera, lit, tuple((None, figure) for _, _, figure in still))

    def truth(self, camera: int, seconds: float) -> CameraTruth:
        """Measure the ground truth on the drawn fish."""
        moment = self._moment(camera, seconds)
        found = measure_visibility(
            self._views[camera], [FigureLayer(number, figure, None) for number, figure in moment.layers]
        )
        numbers = [number for number in sorted(found) if found[number].measurable]
        return CameraTruth(
            np.array([number + 1 for number in numbers], dtype=np.int64),
            np.array([found[number].box for number in numbers], dtype=np.float64).reshape(-1, 4),
            np.array([found[number].share for number in numbers], dtype=np.float64),
            moment.distance[numbers],
        )

    def positions(self, seconds: float) -> Floats:
        """Return the points of the seabed below all fish."""
        return self._shoal.at(seconds).places[:, :2].copy()

    def inside(self, seconds: float) -> NDArray[np.bool_]:
        """Return which fish are in the tank: all."""
        return np.ones(len(self._shoal.at(seconds).places), dtype=np.bool_)

    def homography(self, camera: int) -> Floats | None:  # noqa: ARG002 — there is no floor
        """Return None: there is no floor."""
        return None

    def _create_bed(self, camera: int) -> Seabed:
        return Seabed(self._views[camera])

    def _paint(self, camera: int, lit: Bytes, layers: tuple[tuple[int | None, Figure], ...]) -> Bytes:
        image = lit.copy()
        for _, figure in layers:
            paste(image, self._views[camera], figure)
        return image

    def _draw(self, camera: int, seconds: float) -> _Moment:
        view = self._views[camera]
        lit = self._bed(camera).lit(seconds)
        swimmers = self._shoal.at(seconds)
        distance = np.linalg.norm(swimmers.places - view.center, axis=1)
        figures = draw_fish(view, fish_vertices(swimmers), caustics(seconds))
        layers: list[tuple[float, int | None, Figure]] = self._still(camera, lit, seconds)
        layers += [
            (far, number, figure)
            for number, (far, figure) in enumerate(zip(distance.tolist(), figures, strict=True))
            if figure is not None
        ]
        layers.sort(key=lambda layer: -layer[0])
        return _Moment(lit, tuple((number, figure) for _, number, figure in layers), distance)

    def _still(self, camera: int, lit: Bytes, seconds: float) -> list[tuple[float, int | None, Figure]]:
        """Return weeds and rocks, which hide fish, farthest first: distance, None and figure."""
        layers: list[tuple[float, int | None, Figure]] = []
        layers += [(clump.distance, None, clump.figure) for clump in self._weeds[camera].at(seconds)]
        for rock in self._bed(camera).rocks:
            colors = cv2.multiply(lit[rock.area], cv2.merge([rock.share] * 3), scale=1 / 255)
            patch = np.dstack([colors, rock.share])
            layers.append((rock.distance, None, Figure(rock.area[1].start, rock.area[0].start, patch)))
        return sorted(layers, key=lambda layer: -layer[0])
