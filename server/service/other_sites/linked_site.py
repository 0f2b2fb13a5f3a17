"""A site that this one is linked with: whether it is there, and which viewers it tells who is there."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from server.config.sections import LinkSettings
from server.messaging.site_people import (
    DIGEST_BYTES,
    SitePeople,
    TokenDigest,
    Viewers,
    unpack_reference_histogram,
)

HEARD_S = 5.0
"""Seconds after its last message for which a site counts as there."""
SILENT_S = 30.0
"""Seconds after its last message after which those whom it saw count as having left."""
_RENUMBERED = 3
"""Messages in a row after which a site's numbers have begun anew."""


@dataclass(slots=True)
class LinkedSite:
    """What is known about another site."""

    name: str
    settings: LinkSettings
    heard_at: float | None = None
    """Of its last message, monotonic seconds."""
    index: int = -1
    numbered_since: float | None = None
    is_missed: bool = False
    """Whether it was logged that nothing was heard of it."""
    refused: str = ""
    """Why its messages are not used; empty: they are."""
    viewers: Viewers = field(default_factory=Viewers)
    reference_histogram: NDArray[np.float64] | None = None
    _begins_anew: int = 0
    """Messages in a row in which its numbers began at another time."""

    def has_renumbered(self, since: float) -> bool | None:
        """Return whether a site's numbers have begun anew; None: only if it says so several times in a row.

        For a moment two of a site's services may both lead, one of which has just started.
        """
        if self.numbered_since in {None, since}:
            self._begins_anew = 0
            return False
        self._begins_anew += 1
        return True if self._begins_anew >= _RENUMBERED else None

    def is_there(self, now: float, within: float = HEARD_S) -> bool:
        """Return whether it has been heard lately, and is not refused."""
        return not self.refused and self.heard_at is not None and now < self.heard_at + within

    def may_know(self, token_sha256: str | None, number: int) -> bool:
        """Return whether the site would tell the holder of a token that a person is there."""
        if self.viewers.is_open:
            return True
        if token_sha256 is None:
            return False
        digest = token_digest(self.viewers.salt, token_sha256)
        return any(token.digest == digest and token.object in {0, number} for token in self.viewers.tokens)


def reference_histogram_of(message: SitePeople) -> NDArray[np.float64] | None:
    """Return how a site's cameras render people; None: the message does not say."""
    if message.reference_histogram is None or not message.reference_histogram.histogram:
        return None
    return unpack_reference_histogram(message.reference_histogram)


def token_digest(salt: bytes, token_sha256: str) -> bytes:
    """Return what a site tells of a token that it accepts."""
    return hashlib.sha256(salt + token_sha256.encode()).digest()[:DIGEST_BYTES]


def viewers_of(salt: bytes, tokens: Iterable[tuple[str, int]]) -> Viewers:
    """Return who may know who is at a site: tokens' SHA-256 with the only person each is for, or 0."""
    digests = [TokenDigest(token_digest(salt, sha256), number) for sha256, number in tokens]
    return Viewers(salt=salt, tokens=digests)
