"""Watches a camera's pictures, and says what is wrong with them once that has lasted.

Several times a second a picture is compared with the camera's reference (`reference`), which follows slowly
what is seen while nothing is wrong, and with the pictures before (`stillness`).
"""

from __future__ import annotations

from collections import Counter, deque

from tracking.detectors.base import Image
from tracking.picture_condition.cover import CoverFinder
from tracking.picture_condition.reference import Reference
from tracking.picture_condition.stillness import StillnessMonitor, forget_before
from tracking.picture_condition.structure import Cells, Structure, reduce, structure_of
from tracking.types import PictureCondition

# Seconds between the pictures that are looked at, and between those that enter the reference.
_LOOK_EVERY_S, _LEARN_EVERY_S = 0.2, 1.0
# Seconds from which the first reference is, and over which it is averaged then.
_FIRST_S, _AVERAGE_S = 2.0, 30.0
# Seconds after which another scene is accepted: somebody wants the camera there.
_ACCEPT_S = 300.0
# Seconds of signs until a condition is reported, and without them until it is taken back; the share of the
# pictures that must agree.
_REPORT_S, _RECOVER_S, _AGREE = 3.0, 2.0, 0.9
# What covers a lens may look like another scene: the first report of either stands.
_HIDING = {"covered", "turned"}
# Seconds between the pictures that show whether something stands still.
_APART_S = 1.0


class PictureMonitor:
    """Watches the pictures of one camera.

    Args:
        fps: frames per second.
    """

    def __init__(self, fps: float) -> None:
        self._fps = fps
        self._frame = -1
        self._looked: float | None = None
        self._stillness = StillnessMonitor()
        self._recent: deque[tuple[float, Structure]] = deque()
        self._cover = CoverFinder()
        self._cover_agreed_s = 0.0
        """When `covered_share` last agreed with whether anything is covered."""
        self._reference: Reference | None = None
        self._learned_s = self._unlearned_s = 0.0
        self._signs: deque[tuple[float, int, PictureCondition]] = deque()
        self.condition: PictureCondition = "clear"
        """What is wrong with the picture."""
        self.since = 0
        """The frame in which that began."""
        self.shows_another_scene = False
        """Whether the camera was turned away and has not come back, even if what it shows was accepted."""
        self.covered_share = 0.0
        """The covered share of the picture, once that has lasted; the rest may be clear."""

    @property
    def shows_now(self) -> bool:
        """Whether what is seen is what happens now, in a part of the picture at least."""
        if self.condition == "covered":
            return self._cover.rest_is_seen
        return not self._stillness.repeats

    @property
    def covered(self) -> Cells | None:
        """The cells `(R, C)` of the pictures in which a cover hides all; None: there is none."""
        return self._cover.cells

    def observe(self, image: Image, frame: int | None = None) -> PictureCondition:
        """Return the camera's condition up to the next frame.

        Args:
            image: `(H, W, 3)` uint8.
            frame: its number; `None`: the one after the last.
        """
        self._frame = self._frame + 1 if frame is None else frame
        seconds = self._frame / self._fps
        if self._looked is not None and seconds - self._looked < _LOOK_EVERY_S - 0.5 / self._fps:
            return self.condition
        elapsed = 0.0 if self._looked is None else min(seconds - self._looked, _LEARN_EVERY_S)
        self._looked = seconds
        self._signs.append((seconds, self._frame, self._sign(image, seconds, elapsed)))
        while self._signs[0][0] < seconds - _REPORT_S:
            self._signs.popleft()
        self._decide(seconds)
        self._report_cover(seconds)
        if self.condition == "turned" and seconds - self.since / self._fps >= _ACCEPT_S:
            self._begin_again()
        return self.condition

    def accept_scene(self) -> None:
        """Take what the camera shows from now on for what it should: where that is, is known."""
        self._begin_again()
        self.shows_another_scene = False

    def _begin_again(self) -> None:
        """Learn the reference anew; nothing is wrong until then."""
        self._reference, self._learned_s = None, 0.0
        self._cover.forget()
        self.covered_share = 0.0
        self._signs.clear()
        if self.condition != "clear":
            self.condition, self.since = "clear", self._frame

    def _report_cover(self, seconds: float) -> None:
        """Report the share of a cover that has lasted, or that there has been none for a while."""
        share = 0.0 if self.covered is None else float(self.covered.mean())
        if (share > 0.0) is (self.covered_share > 0.0):
            self._cover_agreed_s = seconds
        elif seconds - self._cover_agreed_s < (_REPORT_S if share else _RECOVER_S):
            return
        self.covered_share = share

    def _sign(self, image: Image, seconds: float, elapsed: float) -> PictureCondition:
        """Return what seems to be wrong with a picture."""
        still = self._stillness.is_frozen(image, seconds, elapsed)
        structure = structure_of(reduce(image))
        last = self._recent[-1][1] if self._recent else structure
        self._recent.append((seconds, structure))
        forget_before(self._recent, seconds - _APART_S)
        _, before = self._recent[0]
        if self._reference is None:
            self._reference = Reference(structure)
        if still and self._reference.is_seen(structure):
            return "frozen"
        noise = structure.noise(last)
        if self._learned_s >= _FIRST_S:
            self._cover.observe(structure, self._reference.structure, noise, elapsed)
            sign = self._reference.sign(structure, before, noise, seconds)
            if sign != "clear" or still:
                return "frozen" if sign == "clear" else sign
        self._unlearned_s += elapsed
        if self._learned_s < _FIRST_S or self._unlearned_s >= _LEARN_EVERY_S:
            self._learned_s += self._unlearned_s
            span = min(max(self._learned_s, self._unlearned_s), _AVERAGE_S)
            share = self._unlearned_s / span if span else 1.0
            self._reference.learn(structure, share, self._cover.mask(structure.gray.shape), noise)
            self._unlearned_s = 0.0
        return "clear"

    def _decide(self, seconds: float) -> None:
        """Report a condition that has lasted, or take it back."""
        signs = [(frame, sign) for _, frame, sign in self._signs]
        whole = self._signs[0][0] <= seconds - _REPORT_S + _LOOK_EVERY_S
        if signs[-1][1] == "frozen":  # its stillness has been watched for seconds
            if self.condition != "frozen":
                self.condition, self.since = "frozen", self._frame
        elif self.condition == "clear":
            wrong = [each for each in signs if each[1] != "clear"]
            if whole and len(wrong) >= _AGREE * len(signs):
                self.condition = Counter(sign for _, sign in wrong).most_common(1)[0][0]
                self.since = wrong[0][0]
                self.shows_another_scene |= self.condition == "turned"
        else:
            recent = [(frame, sign) for time, frame, sign in self._signs if time >= seconds - _RECOVER_S]
            other, count = Counter(sign for _, sign in recent).most_common(1)[0]
            changed = other == "clear" or (whole and {other, self.condition} != _HIDING)
            if other != self.condition and changed and count >= _AGREE * len(recent):
                if "turned" in {other, self.condition}:
                    self.shows_another_scene = other != "clear"
                self.condition, self.since = other, recent[0][0]
