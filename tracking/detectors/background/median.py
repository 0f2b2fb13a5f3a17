"""Median background model, which absorbs neither people nor their ghosts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats
from tracking.detectors.background.flicker import FlickerFinder
from tracking.detectors.background.light.frame_light import FrameLight, fit_frame_light
from tracking.detectors.background.light.local_light import reduce_to_cells
from tracking.detectors.background.light.tone_curve import IDENTITY
from tracking.detectors.background.median_samples import MedianSamples
from tracking.detectors.background.motion import STILL, Motion
from tracking.detectors.background.registration import Registration, count_edges
from tracking.detectors.background.segmentation import (
    Segmentation,
    ShadowSettings,
    exceeding,
    largest_difference,
    shadow_mask,
    smoothed,
)
from tracking.detectors.background.static_foreground import GhostFinder, StaticForegroundSettings
from tracking.detectors.background.views.known_views import KnownViews, shows_view
from tracking.detectors.background.views.turn_finder import TurnFinder
from tracking.detectors.background.views.view_matching import ViewMatch
from tracking.detectors.base import Image, Mask, require_at_least_one, require_positive
from tracking.frame_rate import DEFAULT_FPS, frames_in


@dataclass(frozen=True, slots=True)
class MedianSettings:
    """The gain-compensated median background.

    Raises:
        ValueError: a setting is out of range.
    """

    bootstrap_s: float = 2.0  # seconds whose median is the first background; longer below `samples` frames
    samples: int = 15  # frames of them that enter the median; odd
    threshold: float = (
        24.0  # largest difference over the channels, in gray levels, above which a pixel is foreground
    )
    learn_every_s: float = 0.2  # seconds between two updates of the background
    learn_s: float = 10.0  # seconds in which the background follows a change, where no person is
    relearn_share: float = 0.5  # foreground share of the image that indicates another view
    relearn_s: float = 0.4  # seconds of such frames before the background is learned again

    def __post_init__(self) -> None:
        require_at_least_one(self, "samples")
        require_positive(self, "bootstrap_s", "learn_every_s", "learn_s", "relearn_s")


class MedianBackground:
    """Background model of one camera: the median of the first frames, updated where no people are.

    It is usable after half of the bootstrap; the median is computed again at its end. Frames are compared at
    their light (`tone_curve`) and where the camera has moved to (`registration`).
    """

    def __init__(
        self,
        settings: MedianSettings,
        static: StaticForegroundSettings,
        shadows: ShadowSettings,
        fps: float = DEFAULT_FPS,
    ) -> None:
        self._settings = settings
        self._fps = fps
        self._bootstrap_frames = frames_in(settings.bootstrap_s, fps, settings.samples)
        self._learn_every = frames_in(settings.learn_every_s, fps)
        self._learn_rate = min(self._learn_every / fps / settings.learn_s, 1.0)
        self._points_every = self._learn_every * frames_in(_POINTS_EVERY_S, fps / self._learn_every)
        self._relearn_frames = frames_in(settings.relearn_s, fps, _MIN_RELEARN_FRAMES)
        self._static_filter = GhostFinder(static, fps)
        self.flicker = FlickerFinder(frames_in(static.check_every_s, fps) / fps)
        self._differing: Mask | None = None
        """Foreground of the last frame, flicker included."""
        self._shadows = shadows
        self._registration = Registration(fps)
        self._samples = MedianSamples()
        self._frames = 0
        self._flooded = 0
        self._exact: npt.NDArray[np.float32] | None = None
        self._rounded: Image | None = None
        self._reduced_from: Image | None = None
        self._reduced: Image = np.empty((0, 0, 3), dtype=np.uint8)
        self._light: FrameLight | None = None
        """Of the last frame."""
        self._unlikely: Mask | None = None
        self._known, self._turns = KnownViews(), TurnFinder(fps)
        self.views = 0
        """How many times another view was learned."""
        self._last: Image | None = None
        """The last frame, where the background is."""
        self.hidden: Mask | None = None
        """`(H, W)`, 255 where frames do not show the scene: the lens is covered; None: nowhere."""

    @property
    def turned(self) -> Floats | None:
        """How the present view was turned from the first one, (3, 3), its own pixels; None: unknown."""
        return self._known.homography

    def moved(self, size: tuple[int, int]) -> Floats | None:
        """Return how the first view has moved to where the camera rests, (3, 3); pictures have a size (w, h).

        None: the camera shows another view, which could not be located.
        """
        turned = self._known.homography
        return None if turned is None else np.asarray(self._registration.rest.homography(size) @ turned)

    def prepare(self, images: Sequence[Image]) -> None:
        """Learn the background from images before the first frame; without any, learn it live."""
        for image in images:
            self._samples.add(image)
        if self._samples:
            self._use(self._background_of_samples())
            self._frames, self._samples = self._bootstrap_frames, MedianSamples()

    def segment_still(self, image: Image) -> Segmentation | None:
        """Segment an image that is not the next frame."""
        if self._rounded is None:
            return None
        motion = self._registration.find_still(image)
        aligned = motion.align(image, self._rounded)
        return self._compare(aligned, motion, self._rounded, self._fit_light(aligned, self._rounded))

    def segment(self, image: Image) -> Segmentation | None:
        """Segment the next frame; `None` while the background is unknown."""
        self._bootstrap(image)
        self._frames += 1
        background = self._rounded
        if background is None:
            return None
        before, looks = self._light, self._registration.is_due()
        aligned, motion = self._align(image, background, before, looks=looks)
        light = self._fit_light(aligned, background, before)
        if not looks and before is not None and light.curves.agreement < before.curves.agreement - _MOVED:
            aligned, motion = self._align(image, background, before, looks=True)
            if motion != self._registration.rest:
                light = self._fit_light(aligned, background, before)
        self._last, self._light = aligned, light
        if (turn := self._turns.find(self._registration.agreement, background, image)) is not None:
            self._learn_view(background, turn)
            return None
        if light.curves.contrast_of(self._cells_of(background)) < _BLIND:
            return None
        segmentation = self._compare(aligned, motion, background, light)
        self._flooded = self._flooded + 1 if self._is_flooded(segmentation) else 0
        if self._flooded >= self._relearn_frames:
            self._invalidate(image, background)
            return None
        # At the background's light, and without noise, people look the same whatever the exposure is.
        smooth = smoothed(aligned) if light.noise > _NOISY else aligned
        self._differing, flicker = segmentation.foreground, self.flicker.mask
        segmentation = replace(segmentation, image=light.remove(smooth))
        return segmentation if flicker is None else segmentation.without(flicker)

    def relit(self, image: Image) -> Image:
        """Return the last frame, at any size, in the background's light if it has lost contrast to its own.

        Networks hardly know people in the dark or in fog.
        """
        light, background = self._light, self._rounded
        if light is None or background is None:
            return image
        contrast = float(np.mean(light.contrast_of(self._cells_of(background))))
        if contrast >= _DULL:
            return image
        return light.remove(smoothed(image) if light.noise > _NOISY * contrast else image)

    def learn(self, foreground: Mask, occupied: Mask) -> None:
        """Update the background with the last frame, except where people are.

        Args:
            foreground: `(H, W)`, the cleaned foreground of that frame.
            occupied: `(H, W)`, 255 where a person is.
        """
        occupied = occupied if self.hidden is None else occupied | self.hidden
        unlikely = occupied | foreground
        self._unlikely = self.hidden if self._is_mostly(unlikely) else unlikely
        if self._exact is None or self._rounded is None or self._last is None or self._light is None:
            return
        checks_static, updates = self._static_filter.is_due(), self._frames % self._learn_every == 0
        if not (checks_static or updates):
            return
        leveled = self._light.remove(self._last, self._rounded)
        if checks_static and self._differing is not None:
            self.flicker.check(leveled, self._differing)
        static = self._static_filter.find(leveled, self._rounded, foreground) if checks_static else None
        if static is not None:
            self._exact[static > 0] = leveled[static > 0]
        if updates:
            unoccupied = cv2.bitwise_not(occupied)
            cv2.accumulateWeighted(leveled, self._exact, self._learn_rate, mask=unoccupied)
        elif static is None:
            return
        self._rounded = np.rint(self._exact).astype(np.uint8)
        if self._frames % self._points_every == 0:
            self._registration.set_background(self._rounded)
            if self._known.homography is None and self._frames % (_LOCATE_EVERY * self._points_every) == 0:
                self._known.locate(self._rounded)

    def _align(
        self, image: Image, background: Image, before: FrameLight | None, *, looks: bool
    ) -> tuple[Image, Motion]:
        """Return a frame where the background is, and its motion; without `looks` the camera is at rest."""
        motion = self._registration.rest
        if looks:
            motion = self._registration.find(
                image, IDENTITY if before is None else before.curves, self._unlikely
            )
        outside = background if motion == STILL or before is None else before.apply(background)
        return motion.align(image, outside), motion

    def _fit_light(self, image: Image, background: Image, before: FrameLight | None = None) -> FrameLight:
        """Return the light of an aligned frame against a background."""
        looks_for_haze = before is None or self._frames % self._learn_every == 0
        return fit_frame_light(
            image,
            background,
            self._cells_of(background),
            self._unlikely,
            before,
            looks_for_haze=looks_for_haze,
        )

    def _compare(self, image: Image, motion: Motion, background: Image, light: FrameLight) -> Segmentation:
        """Return the segmentation of an aligned image against the background at the image's light."""
        expected, noise = light.apply(background), light.noise
        if noise > _NOISY:
            image, expected, noise = smoothed(image), smoothed(expected), _SMOOTHED_NOISE * noise
        difference = largest_difference(image, expected)
        lit = light.apply_local(expected)
        if lit is not None:
            lit_difference = largest_difference(image, lit)
            np.copyto(expected, lit, where=(lit_difference < difference)[..., None])
            difference = np.minimum(difference, lit_difference)
        # In a darker picture people differ by less, and so does what is not there: by the noise at least.
        contrast = np.maximum(light.contrast_of(self._cells_of(background)), _LEAST_CONTRAST)
        thresholds = np.clip(contrast * self._settings.threshold, _NOISES * noise, self._settings.threshold)
        mask = exceeding(difference, np.asarray(thresholds, dtype=np.float32))
        shadow = shadow_mask(image, expected, mask, self._shadows)
        return Segmentation(mask & ~shadow, shadow, image, motion)

    def _cells_of(self, background: Image) -> Image:
        """Return the cells of a background; those of the last one are kept."""
        if background is not self._reduced_from:
            self._reduced_from, self._reduced = background, reduce_to_cells(background)
        return self._reduced

    def _bootstrap(self, image: Image) -> None:
        frames, samples, done = self._bootstrap_frames, self._settings.samples, self._frames + 1
        if done > frames:
            return
        # Spread the samples evenly, the last one on the last frame.
        if done * samples // frames > self._frames * samples // frames:
            if self.views and self._samples.have_moved(image):  # the camera still turns
                self._frames, self._samples, done = 0, MedianSamples(), 1
                self._known.forget_place()
            self._samples.add(image)
        if done in {(frames + 1) // 2, frames} and self._samples:
            self._use(self._background_of_samples())
        if done == frames:
            self._samples = MedianSamples()

    def _background_of_samples(self) -> Image:
        """Return the background that the samples show, less people who hide what was known of the view."""
        background = self._samples.median(None)
        if not self.views:
            return background
        self._known.locate(background)
        before = self._known.last_turned()
        if before is None and self._known.last is not None and shows_view(self._known.last, background):
            before = self._known.last
            self._known.stay()
        return background if before is None else self._samples.median(before)

    def _use(self, background: Image) -> None:
        """Compare frames with this background from now on."""
        self._rounded, self._exact = background, background.astype(np.float32)
        self._registration = Registration(self._fps)
        self._registration.set_background(background)
        self._light = self._unlikely = None

    def _is_flooded(self, segmentation: Segmentation) -> bool:
        """Return whether so much of a frame is foreground that the background no longer explains it."""
        return self._is_mostly(segmentation.foreground | segmentation.shadow, self._settings.relearn_share)

    def _is_mostly(self, mask: Mask, share: float = 0.5) -> bool:
        """Return whether a mask `(H, W)` has more than a share of what is not hidden."""
        if self.hidden is None:
            return cv2.countNonZero(mask) > share * mask.size
        shown = ~self.hidden
        return cv2.countNonZero(mask & shown) > share * cv2.countNonZero(shown)

    def _invalidate(self, image: Image, background: Image) -> None:
        """Go back to the background before this one if it explains the frame, or learn another one.

        While the lens is covered there is nothing to learn, and the background is kept.
        """
        if count_edges(image) < _COVERED * count_edges(background):
            return
        last = self._known.last
        if last is not None:
            light = self._fit_light(image, last)
            explains = not self._is_flooded(self._compare(image, STILL, last, light))
            if explains and shows_view(last, image, _SEEN_WITH_PEOPLE):
                self._known.go_back(background)
                self._use(last)
                self._flooded = 0
                return
        self._learn_view(background)

    def _learn_view(self, background: Image, turn: ViewMatch | None = None) -> None:
        """Learn the background of another view; `turn`: where the present one lies in it, if known."""
        self._known.leave(background, turn)
        self._frames, self._samples = 0, MedianSamples()
        self._exact = self._rounded = self._light = self._unlikely = None
        self._flooded = 0
        self.views += 1


# Seconds until the background's edges are sought again.
_POINTS_EVERY_S = 2.0
# Share of a background's edges that a picture of its view shows, though people hide some.
_SEEN_WITH_PEOPLE = 0.4
# How many times rarer a view that could not be located is sought again.
_LOCATE_EVERY = 4
# Fewest frames that show that another background is needed.
_MIN_RELEARN_FRAMES = 3
# Drop of the share of pixels that follow the tone curves at which a camera at rest may have moved.
_MOVED = 0.03
# Share of the background's contrast below which the lens is covered, in fog, or in the dark.
_BLIND = 0.1
# Least share of the threshold in a darker picture, and the least threshold in deviations of the noise.
_LEAST_CONTRAST, _NOISES = 0.4, 4.0
# Share of the background's edges below which the lens is covered.
_COVERED = 0.25
# Noise, in gray levels, from which frames are smoothed, and the share of it that is left then.
_NOISY, _SMOOTHED_NOISE = 6.0, 0.3
# Share of the background's contrast below which a frame is relit.
_DULL = 0.7
