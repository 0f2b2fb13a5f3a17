"""Identity across sites: series of ids, sightings by other sites, and appearance compared between them.

Each site has a registry of its own. Ids are unique over all of them, since each assigns only those of its
series. Appearance travels as a person's mean histogram over the site's cameras, with that of all people of
the site: if two sites see about the same people, the same coat is at the same quantiles in both.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview.association.appearance.histograms import (
    HistogramEqualizer,
    MeanHistogram,
    PersonAppearance,
    cdf_distance,
    equalized_by,
)

Floats = NDArray[np.float64]
_PRIOR_TRACKS = 20.0
"""How many tracks two sites must have seen before their people count as much as a uniform distribution. Until
then two sites that have seen different people would see one person differently."""


@dataclass(frozen=True, slots=True)
class IdSeries:
    """The ids that one of several sites assigns; no two series share one.

    Attributes:
        index: of the site, from 0.
        step: how many sites there may be.
    """

    index: int = 0
    step: int = 1

    def has(self, person_id: int) -> bool:
        """Return whether an id is of this series."""
        return (person_id - 1) % self.step == self.index

    def first_from(self, person_id: int) -> int:
        """Return the lowest id of the series from an id on.

        >>> IdSeries(1, 3).first_from(2), IdSeries(1, 3).first_from(3)
        (2, 5)
        """
        least = max(person_id, 1)
        return least + (self.index + 1 - least) % self.step


SINGLE_SITE = IdSeries()
"""All ids."""


@dataclass(frozen=True, slots=True, eq=False)
class SiteSighting:
    """A person whom another site sees, or has seen last.

    Attributes:
        person_id: their id, at all sites.
        site: its name.
        camera: of that site, which has seen them last.
        frame: of the last sighting, in this site's frames.
        is_visible: whether the site sees them now.
        histogram: mean over the site's cameras; None: as known before.
    """

    person_id: int
    site: str
    camera: str
    frame: int
    is_visible: bool
    histogram: MeanHistogram | None = None

    @property
    def camera_name(self) -> str:
        """The camera's name among those of all sites."""
        return f"{self.site}/{self.camera}"


def sum_over_cameras(appearances: Iterable[PersonAppearance]) -> MeanHistogram | None:
    """Add up what a site's cameras have seen of a person; None: nothing."""
    histograms = [
        histogram
        for appearance in appearances
        for _, histogram in sorted(appearance.by_camera.items())
        if histogram.frame_count
    ]
    frames_of_bins: Counter[int] = Counter()
    for histogram in histograms:
        frames_of_bins[histogram.histogram_sum.size] += histogram.frame_count
    if not frames_of_bins:
        return None
    bins = max(frames_of_bins, key=lambda size: (frames_of_bins[size], size))
    total = np.sum([each.histogram_sum for each in histograms if each.histogram_sum.size == bins], axis=0)
    return MeanHistogram(total, frames_of_bins[bins])


@dataclass(slots=True)
class ReferenceHistograms:
    """How other sites render people: (B,) sums of normalized histograms, by site and number of bins."""

    by_site: dict[tuple[str, int], Floats] = field(default_factory=dict)

    def put(self, site: str, histogram: Floats) -> None:
        """Replace that of a site."""
        self.by_site[site, histogram.size] = histogram

    def distances(
        self,
        equalizer: HistogramEqualizer,
        new: Sequence[PersonAppearance],
        old: Sequence[Mapping[str, MeanHistogram]],
    ) -> Floats:
        """Compute (N, L) appearance distances of people here from people of other sites; NaN: unknown.

        Both are equalized by the people of their site, which weigh as much as those of the site that has
        seen fewer.

        Args:
            equalizer: of this site.
            new: N people here.
            old: the mean histograms of L people at other sites, by site.
        """
        total, count = np.zeros((len(new), len(old))), np.zeros((len(new), len(old)))
        own = [sum_over_cameras([appearance]) for appearance in new]
        for (site, bins), indices in _by_site(old).items():
            theirs, here = self.by_site.get((site, bins), np.zeros(bins)), equalizer.reference_histogram(bins)
            weight = min(float(theirs.sum()), float(here.sum()))
            rows = [i for i, mean in enumerate(own) if mean and mean.histogram_sum.size == bins]
            if not rows:
                continue
            columns = list(indices)
            curves = equalized_by(_with_prior(here, weight), _means(own[i] for i in rows))
            others = equalized_by(_with_prior(theirs, weight), _means(indices.values()))
            places = np.ix_(rows, columns)
            total[places] += cdf_distance(curves[:, None], others[None])
            count[places] += 1.0
        return np.asarray(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))


def _by_site(
    people: Sequence[Mapping[str, MeanHistogram]],
) -> Mapping[tuple[str, int], dict[int, MeanHistogram]]:
    """Return histograms by index of the person, by site and number of bins."""
    found: dict[tuple[str, int], dict[int, MeanHistogram]] = {}
    for i, by_site in enumerate(people):
        for site, histogram in sorted(by_site.items()):
            found.setdefault((site, histogram.histogram_sum.size), {})[i] = histogram
    return found


def _with_prior(reference: Floats, weight: float) -> Floats:
    """Return what histograms are equalized by: a site's people, who weigh so many tracks, and the prior."""
    share = weight / float(reference.sum()) if weight else 0.0
    return np.asarray(_PRIOR_TRACKS / reference.size + share * reference)


def _means(histograms: Iterable[MeanHistogram | None]) -> Floats:
    return np.array([histogram.mean for histogram in histograms if histogram is not None])
