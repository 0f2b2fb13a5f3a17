"""People with an id."""

from __future__ import annotations

from dataclasses import dataclass, field

from bestview.association.affinity.travel_times import CameraSighting
from bestview.association.appearance.histograms import MeanHistogram, PersonAppearance
from bestview.association.registry.other_sites import SiteSighting


@dataclass(slots=True, eq=False)
class Person:
    """A person with an id.

    Attributes:
        person_id: from 1, never reused.
        last_frame: frame of the last sighting.
        camera: of the last sighting; of several the first by name.
        departed: reported as departed, and not back yet.
        appearance: of the settled tracklets.
        settled_frames: their frames that were published with this id.
        unused_since: frame since which no cluster has the id; -1: one has it.
        site_histograms: at other sites, by site.
        elsewhere: another site has seen them last; they take part in no clustering.
        visible_elsewhere: it sees them now, so that nobody here is them.
    """

    person_id: int
    last_frame: int = -1
    camera: str = ""
    departed: bool = False
    appearance: PersonAppearance = field(default_factory=PersonAppearance)
    settled_frames: int = 0
    unused_since: int = -1
    site_histograms: dict[str, MeanHistogram] = field(default_factory=dict)
    elsewhere: bool = False
    visible_elsewhere: bool = False

    @property
    def last_sighting(self) -> CameraSighting:
        """Camera and frame of the last sighting."""
        return CameraSighting(self.camera, self.last_frame)

    def add_sighting(self, camera: str, frame: int) -> None:
        """Record a sighting."""
        if frame > self.last_frame or (frame == self.last_frame and camera < self.camera):
            self.last_frame, self.camera = frame, camera
            self.elsewhere = self.visible_elsewhere = False

    def add_site_sighting(self, sighting: SiteSighting) -> None:
        """Record that another site sees the person, unless this one has seen them since."""
        if sighting.histogram is not None:
            self.site_histograms[sighting.site] = sighting.histogram
        if self.elsewhere or sighting.frame > self.last_frame:
            self.last_frame, self.camera = sighting.frame, sighting.camera_name
            self.elsewhere, self.visible_elsewhere = True, sighting.is_visible

    def merge(self, other: Person) -> None:
        """Add everything known about `other`: the two are one person."""
        self.appearance.add_all(other.appearance)
        if not other.elsewhere:
            self.add_sighting(other.camera, other.last_frame)
        self.settled_frames += other.settled_frames
        self.site_histograms = other.site_histograms | self.site_histograms
