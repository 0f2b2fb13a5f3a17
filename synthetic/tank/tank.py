"""The tank: the world of the scene of fish. x runs east, y away from the first camera, z up, in metres."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats, Perspective, Viewpoint
from synthetic.drawing.compositing import paste
from synthetic.drawing.figure import Figure
from synthetic.ground_truth import CameraTruth
from synthetic.tank.bed import Bed
from synthetic.tank.fish import shape
from synthetic.tank.paint import draw_fish
from synthetic.tank.shoal import Shoal
from synthetic.tank.water import light_net
from synthetic.tank.weeds import Weeds
from synthetic.visibility import Piece, survey
from synthetic.world import Asked, Bytes

_EXTENT = (6.0, 5.0)  # metres
VIEWPOINTS = (
    Viewpoint((3.0, -4.4, 1.55), (3.0, 2.5, 1.28), 60.0),
    Viewpoint((10.1, 2.5, 1.55), (3.0, 2.5, 1.28), 60.0),
)


@dataclass(frozen=True, slots=True)
class _Moment:
    """Everything that stands or swims before a camera at a moment, furthest first."""

    lit: Bytes  # (H, W, 3) the bed
    layers: tuple[tuple[int | None, Figure], ...]  # a fish's number, or none of a weed or rock
    away: Floats  # (P,) metres from the camera to every fish


class Tank:
    """Fish that all look the same in a lit, murky tank."""

    def __init__(self, asked: Asked) -> None:
        self._views = [Perspective.of(view, asked.width, asked.height) for view in VIEWPOINTS]
        self._weeds = [Weeds(view) for view in self._views]
        self._shoal = Shoal(asked.objects, asked.seed)
        self._bed = lru_cache(maxsize=None)(self._lay)
        # A recording asks for the picture and the truth of a frame: it is drawn once for both.
        self._moment = lru_cache(maxsize=asked.cameras)(self._draw)

    @property
    def extent(self) -> tuple[float, float]:
        """The tank's, from glass to glass."""
        return _EXTENT

    def picture(self, camera: int, seconds: float) -> Bytes:
        """Paint the tank with all fish in it."""
        moment = self._moment(camera, seconds)
        return self._paint(camera, moment.lit, moment.layers)

    def empty(self, camera: int, seconds: float) -> Bytes:
        """Paint the tank without fish, weeds as they sway at the moment."""
        lit = self._bed(camera).lit(seconds)
        still = self._still(camera, lit, seconds)
        return self._paint(camera, lit, tuple((None, figure) for _, _, figure in still))

    def truth(self, camera: int, seconds: float) -> CameraTruth:
        """Measure all fish as they are drawn."""
        moment = self._moment(camera, seconds)
        found = survey(self._views[camera], [Piece(number, figure, None) for number, figure in moment.layers])
        numbers = [number for number in sorted(found) if found[number].large]
        return CameraTruth(
            np.array([number + 1 for number in numbers], dtype=np.int64),
            np.array([found[number].box for number in numbers], dtype=np.float64).reshape(-1, 4),
            np.array([found[number].share for number in numbers], dtype=np.float64),
            moment.away[numbers],
        )

    def positions(self, seconds: float) -> Floats:
        """Say above which point of the bed every fish is."""
        return self._shoal.at(seconds).places[:, :2].copy()

    def inside(self, seconds: float) -> NDArray[np.bool_]:
        """Say who is in the tank: everybody."""
        return np.ones(len(self._shoal.at(seconds).places), dtype=np.bool_)

    def homography(self, camera: int) -> Floats | None:  # noqa: ARG002 — fish stand nowhere
        """Fish are on no floor."""
        return None

    def _lay(self, camera: int) -> Bed:
        return Bed(self._views[camera])

    def _paint(self, camera: int, lit: Bytes, layers: tuple[tuple[int | None, Figure], ...]) -> Bytes:
        image = lit.copy()
        for _, figure in layers:
            paste(image, self._views[camera], figure)
        return image

    def _draw(self, camera: int, seconds: float) -> _Moment:
        view = self._views[camera]
        lit = self._bed(camera).lit(seconds)
        swimmers = self._shoal.at(seconds)
        away = np.linalg.norm(swimmers.places - view.centre, axis=1)
        figures = draw_fish(view, shape(swimmers), light_net(seconds))
        layers: list[tuple[float, int | None, Figure]] = self._still(camera, lit, seconds)
        layers += [
            (far, number, figure)
            for number, (far, figure) in enumerate(zip(away.tolist(), figures, strict=True))
            if figure is not None
        ]
        layers.sort(key=lambda layer: -layer[0])
        return _Moment(lit, tuple((number, figure) for _, number, figure in layers), away)

    def _still(self, camera: int, lit: Bytes, seconds: float) -> list[tuple[float, int | None, Figure]]:
        """Give what hides fish but is none, furthest first: how far away it is, and how it looks."""
        found: list[tuple[float, int | None, Figure]] = []
        found += [(clump.away, None, clump.figure) for clump in self._weeds[camera].at(seconds)]
        for rock in self._bed(camera).rocks:
            seen = cv2.multiply(lit[rock.area], cv2.merge([rock.share] * 3), scale=1 / 255)
            patch = np.dstack([seen, rock.share])
            found.append((rock.away, None, Figure(rock.area[1].start, rock.area[0].start, patch)))
        return sorted(found, key=lambda layer: -layer[0])
