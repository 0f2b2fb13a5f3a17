"""The frames around each cut of a person's best view, as in the paper's Figs. 23 to 25."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bestview import cut_frames
from server.camera.sources import open_source
from server.cli.evaluate.ground_truth import SceneTruth
from server.cli.evaluate.view_scores import ViewEvaluation
from server.cli.render.plots import new_figure, save_figure
from server.cli.render.site_file import RenderedSite
from server.cli.track.command import read_frames
from server.config.sections import CameraSettings, SiteSettings
from tracking.image_scaling import scale_image

MOST_CUTS = 12
"""Most cuts shown of a person; later ones are left out."""
_AROUND_S = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Seconds from the cut; the frame just before it is shown as well."""
_WIDTH = 240
"""Width of a picture in the strip, in pixels."""
_GREEN = (0, 200, 0)

Image = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, order=True)
class _BestViewFrame:
    """A frame of the best view."""

    camera: int
    frame: int
    """From 0."""


@dataclass(frozen=True, slots=True)
class _Strip:
    """The frames around one cut."""

    cut: int
    frames: tuple[_BestViewFrame, ...]


def plot_strips(
    folder: Path,
    truth: SceneTruth,
    evaluation: ViewEvaluation,
    site_info: RenderedSite,
    videos: Mapping[str, Path],
) -> None:
    """Write `person-K.png` for each person whose best view is cut; boxes are the ground truth's.

    Raises:
        UserError: a video cannot be read.
    """
    strips = {row: _strips(views, site_info.fps) for row, views in enumerate(evaluation.views)}
    wanted = {shown for cuts in strips.values() for strip in cuts for shown in strip.frames}
    images: dict[_BestViewFrame, Image] = {}
    for index, camera in enumerate(truth.cameras):
        numbers = sorted(shown.frame for shown in wanted if shown.camera == index)
        read = _read(videos[camera], site_info, camera, numbers)
        images |= {_BestViewFrame(index, number): image for number, image in read.items()}
    for row, cuts in strips.items():
        if cuts:
            _plot(folder, row, cuts, truth, evaluation, images)


def _strips(views: NDArray[np.int64], fps: float) -> list[_Strip]:
    """Return the strips of (N,) views."""
    strips = []
    for cut in cut_frames(views)[:MOST_CUTS].tolist():
        around = {cut - 1, *(cut + round(seconds * fps) for seconds in _AROUND_S)}
        inside = [frame for frame in sorted(around) if 0 <= frame < len(views) and views[frame] >= 0]
        strips.append(_Strip(cut, tuple(_BestViewFrame(int(views[frame]), frame) for frame in inside)))
    return strips


def _read(video: Path, site_info: RenderedSite, camera: str, numbers: Sequence[int]) -> dict[int, Image]:
    """Return frames of a camera's recording by number, in the camera's picture size."""
    images: dict[int, Image] = {}
    if not numbers:
        return images
    source = open_source(
        CameraSettings(id=camera, source=str(video.absolute())), SiteSettings(fps=site_info.fps)
    )
    wanted = set(numbers)
    for number, image in read_frames(source):
        if number in wanted and image is not None:
            images[number] = scale_image(image, site_info.sizes[camera])
        if number >= numbers[-1]:
            break
    source.close()
    return images


def _plot(
    folder: Path,
    row: int,
    strips: Sequence[_Strip],
    truth: SceneTruth,
    evaluation: ViewEvaluation,
    images: Mapping[_BestViewFrame, Image],
) -> None:
    columns = max(len(strip.frames) for strip in strips)
    figure = new_figure((2.2 * columns, 0.6 + 1.9 * len(strips)))
    axes = figure.subplots(len(strips), columns, squeeze=False)
    for axis in axes.ravel():
        axis.set_axis_off()
    for line, strip in zip(axes, strips, strict=True):
        for axis, shown in zip(line, strip.frames, strict=False):
            image = images.get(shown)
            if image is not None:
                axis.imshow(_with_box(image, truth.boxes[row, shown.frame, shown.camera]))
            mark = ", cut" if shown.frame == strip.cut else ""
            axis.set_title(f"{truth.cameras[shown.camera]}, frame {shown.frame + 1}{mark}", fontsize="small")
    person = truth.people[row]
    figure.suptitle(
        f"Person {person}, object {evaluation.object_of.get(person, '-')}: frames around each cut"
    )
    save_figure(figure, folder / f"person-{person}.png")


def _with_box(image: Image, box: NDArray[np.float64]) -> Image:
    """Return a small RGB picture with the (4,) box; NaN: without a box."""
    scale = _WIDTH / image.shape[1]
    small = scale_image(image, (_WIDTH, max(1, round(image.shape[0] * scale))))
    rgb = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2RGB), dtype=np.uint8)  # a copy: others draw their box
    if not np.isnan(box).any():
        left, top, right, bottom = (round(float(side) * scale) for side in box)
        cv2.rectangle(rgb, (left, top), (right, bottom), _GREEN, 2)
    return rgb
