"""The part of a camera's track that is surely one person."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview.association.appearance.mean_histograms import Looks
from bestview.association.keys import EpisodeKey

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class End:
    """Where an episode begins or ends: frame, (4,) box in pixels, (2,) ground point (NaN: unknown)."""

    frame: int
    box: Floats
    ground: Floats


@dataclass(slots=True, eq=False)
class Episode:
    """Part of one camera's track.

    Attributes:
        key: camera, the camera's number for the track, and the first frame.
        begin: first sighting.
        end: last sighting.
        before: the episode of the same track before this one.
        crowded: frames of crowd between the two.
        frames: sightings.
        free: those outside crowds.
        crowd: of the newest sightings, how many in a row are in a crowd.
        looks: where nobody else was in the box.
        untold: frames whose number has not been told yet.
        told: frames by number told.
        number: the person's; 0: nobody's yet.
        firm: the person's number, if that was settled though the episode goes on; 0: it was not.
        sure: somebody said that it is the same person as the episode before it.
    """

    key: EpisodeKey
    begin: End
    end: End
    before: Episode | None = None
    crowded: int = 0
    frames: int = 0
    free: int = 0
    crowd: int = 0
    looks: Looks = field(default_factory=Looks)
    untold: list[int] = field(default_factory=list)
    told: dict[int, int] = field(default_factory=dict)
    number: int = 0
    firm: int = 0
    sure: bool = False

    @property
    def gap(self) -> int:
        """Frames from the end of the episode before; 0: there was none."""
        return self.begin.frame - self.before.end.frame if self.before is not None else 0

    @property
    def mostly(self) -> int:
        """The number it was told most often, 0 before the first; of equals the lowest."""
        return max(sorted(self.told), key=self.told.__getitem__, default=0)

    def sight(self, frames: range, *, crowded: bool) -> None:
        """Count sightings one after the other, all in a crowd or none."""
        self.frames += len(frames)
        self.free += 0 if crowded else len(frames)
        self.crowd = self.crowd + len(frames) if crowded else 0
        if not self.firm:
            self.untold.extend(frames)

    def tell(self, upto: int) -> bool:
        """Count the frames up to `upto` as told by today's number; say whether any was."""
        told = [frame for frame in self.untold if frame <= upto]
        if told and self.number:
            self.told[self.number] = self.told.get(self.number, 0) + len(told)
        self.untold = self.untold[len(told) :]
        return bool(told and self.number)

    def become(self, number: int) -> None:
        """Count all that was told as told to be this person."""
        self.told = {number: max(1, sum(self.told.values()))}
        self.number = number
        self.firm = number if self.firm else 0

    def goes_on_as(self, number: int, before: Episode) -> None:
        """Take over that somebody said whose it is, and what was before it."""
        self.become(number)
        self.before, self.crowded, self.sure = before, 0, True

    def told_anew(self, lost: int, kept: int) -> None:
        """Count what was told to be one person as told to be another: the two turned out to be one."""
        frames = self.told.pop(lost, 0)
        if frames:
            self.told[kept] = self.told.get(kept, 0) + frames
