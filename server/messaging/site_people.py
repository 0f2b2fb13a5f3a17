"""What a site tells other sites twice a second: who is there, who has left, how they look, who was deleted.

Only what has changed is sent at once; the rest is repeated in turn, so that a site that was cut off or has
just started knows all of it within seconds, and a message is never longer than `MESSAGE_BYTES_MAX`. Times are
seconds before the message: the clocks of two sites may differ, and their pulses count separately.
"""

from __future__ import annotations

from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from server.messaging.camera_identity_snapshot import PERSON_NUMBER_MAX, PersonNumber, UnixTime
from server.messaging.packed_arrays import HISTOGRAM_BINS_MAX, PackedHistogram, histogram_bins

VERSION = 1
"""Of the message; a site that sends another one is refused."""
MESSAGE_BYTES_MAX = 1 << 16
"""Size limit of a message in bytes."""
PEOPLE_MAX = 250
"""People in a message."""
HISTOGRAMS_MAX = 40
"""People in a message whose histograms it has."""
DELETIONS_MAX = 20
"""Deletions in a message."""
VIEWERS_MAX = 256
"""Viewers' tokens in a message."""
CAMERAS_MAX = 1024
DIGEST_BYTES = 16
SALT_BYTES = 16
AGE_MAX_S = 1e6
_SITES_MAX = 1000
_NUMBERS_MAX = 1000

SiteIndex = Annotated[int, msgspec.Meta(ge=0, lt=_SITES_MAX)]
_CameraName = Annotated[str, msgspec.Meta(pattern=r"^[^/\x00-\x1f\x7f]{1,40}\Z")]

_ROW = np.dtype([("number", "<u4"), ("camera", "<u2"), ("age", "<f4"), ("stay", "<f4")])

PackedSightings = Annotated[bytes, msgspec.Meta(max_length=PEOPLE_MAX * _ROW.itemsize)]
"""A row for each person: number (32 bits), camera's index (16 bits), seconds since the last sighting, and
seconds for which they have been there, below 0 if they have left (float32 each); all little-endian."""


class PersonHistogram(msgspec.Struct, frozen=True, kw_only=True):
    """A person's mean color histogram over the site's cameras."""

    number: PersonNumber
    frames: Annotated[int, msgspec.Meta(ge=1, le=2**40)]
    histogram: PackedHistogram

    def __post_init__(self) -> None:
        """Check the histogram.

        Raises:
            ValueError: it is none; decoders then raise a `ValidationError`.
        """
        if not histogram_bins(self.histogram):
            raise ValueError("there is no histogram")


class ReferenceHistogram(msgspec.Struct, frozen=True, kw_only=True):
    """The mean color histogram of all people of a site, by which a person's is equalized."""

    tracks: Annotated[float, msgspec.Meta(ge=0, le=1e12)]
    histogram: Annotated[bytes, msgspec.Meta(max_length=HISTOGRAM_BINS_MAX * 4)]
    """Shares as little-endian float32."""

    def __post_init__(self) -> None:
        """Check the shares.

        Raises:
            ValueError: they are none; decoders then raise a `ValidationError`.
        """
        if len(self.histogram) % 4:
            raise ValueError("the histogram is not of float32")
        shares = np.frombuffer(self.histogram, "<f4")
        if not ((shares >= 0) & (shares <= 1)).all():
            raise ValueError("a share of the histogram is not between 0 and 1")


class SiteDeletion(msgspec.Struct, frozen=True, kw_only=True):
    """A person whose data were deleted, by numbers that one site has assigned."""

    index: SiteIndex
    """The site that has assigned the numbers."""
    numbered_since: UnixTime
    """When that site's numbers began."""
    numbers: Annotated[list[PersonNumber], msgspec.Meta(min_length=1, max_length=_NUMBERS_MAX)]
    deletes_media: bool


class TokenDigest(msgspec.Struct, frozen=True, array_like=True):
    """A token that the site accepts from a viewer."""

    digest: Annotated[bytes, msgspec.Meta(min_length=DIGEST_BYTES, max_length=DIGEST_BYTES)]
    """The beginning of the SHA-256 of the salt and the token's SHA-256: nobody finds the token from it."""
    object: Annotated[int, msgspec.Meta(ge=0, le=PERSON_NUMBER_MAX)] = 0
    """The only person whom it is for; 0: everybody."""


class Viewers(msgspec.Struct, frozen=True, kw_only=True):
    """Who may know who is at the site."""

    is_open: bool = False
    """Everybody: it needs no token."""
    salt: Annotated[bytes, msgspec.Meta(max_length=SALT_BYTES)] = b""
    tokens: Annotated[list[TokenDigest], msgspec.Meta(max_length=VIEWERS_MAX)] = []


class SitePeople(msgspec.Struct, frozen=True, kw_only=True):
    """People whom a site sees or has seen last."""

    version: int = VERSION
    index: SiteIndex
    """Its person numbers are those with this index among `of` sites."""
    of: Annotated[int, msgspec.Meta(ge=1, le=_SITES_MAX)]
    numbered_since: UnixTime
    """When its numbers began: none was assigned twice since."""
    cameras: Annotated[list[_CameraName], msgspec.Meta(max_length=CAMERAS_MAX)]
    people: PackedSightings
    histograms: Annotated[list[PersonHistogram], msgspec.Meta(max_length=HISTOGRAMS_MAX)] = msgspec.field(
        name="looks", default_factory=list
    )
    reference_histogram: ReferenceHistogram | None = msgspec.field(name="population", default=None)
    deletions: Annotated[list[SiteDeletion], msgspec.Meta(max_length=DELETIONS_MAX)] = []
    viewers: Viewers | None = None
    """Null: as before."""

    def __post_init__(self) -> None:
        """Check the sightings.

        Raises:
            ValueError: they are none; decoders then raise a `ValidationError`.
        """
        if len(self.people) % _ROW.itemsize:
            raise ValueError("the sightings are not rows of four numbers")
        rows = np.frombuffer(self.people, _ROW)
        numbers, ages, stays = rows["number"], rows["age"], rows["stay"]
        # NaN is within no limits.
        if not (
            ((numbers >= 1) & (numbers <= PERSON_NUMBER_MAX)).all()
            and (rows["camera"] < len(self.cameras)).all()
            and ((ages >= 0) & (ages <= AGE_MAX_S)).all()
            and ((stays >= -1) & (stays <= AGE_MAX_S)).all()
        ):
            raise ValueError("a sighting is outside of its limits")
        if len(np.unique(numbers)) < len(numbers):
            raise ValueError("a person has two sightings")


class SightingRow(msgspec.Struct, frozen=True):
    """A person in a message: a row of its people."""

    number: int
    camera: str
    age_s: float
    """Since the last sighting."""
    stay_s: float | None
    """For which they have been there; None: they have left."""


def pack_sightings(sightings: list[SightingRow], cameras: list[str]) -> bytes:
    """Pack people, at most `PEOPLE_MAX`; their cameras must be in the list."""
    index = {camera: place for place, camera in enumerate(cameras)}
    rows = [
        (
            sighting.number,
            index[sighting.camera],
            min(sighting.age_s, AGE_MAX_S),
            -1.0 if sighting.stay_s is None else min(sighting.stay_s, AGE_MAX_S),
        )
        for sighting in sightings[:PEOPLE_MAX]
    ]
    return np.array(rows, dtype=_ROW).tobytes()


def unpack_sightings(message: SitePeople) -> list[SightingRow]:
    """Return the people in a message."""
    return [
        SightingRow(number, message.cameras[camera], age, None if stay < 0 else stay)
        for number, camera, age, stay in np.frombuffer(message.people, _ROW).tolist()
    ]


def pack_reference_histogram(histogram_sum: NDArray[np.float64]) -> ReferenceHistogram:
    """Pack the sum of all tracks' normalized histograms (B,)."""
    tracks = float(histogram_sum.sum())
    shares = histogram_sum / tracks if tracks > 0 else histogram_sum
    return ReferenceHistogram(tracks=tracks, histogram=np.clip(shares, 0.0, 1.0).astype("<f4").tobytes())


def unpack_reference_histogram(reference: ReferenceHistogram) -> NDArray[np.float64]:
    """Return the sum of the tracks' histograms (B,)."""
    return np.frombuffer(reference.histogram, "<f4").astype(np.float64) * reference.tracks
