"""Parameter sets of a stream, which a decoder needs before the first picture: what H.264 and H.265 share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

MAX_SET_BYTES = 0xFFFF
"""The length fields of the decoder configuration records have 16 bits."""


class UnsupportedParametersError(Exception):
    """The parameter sets are damaged or use features that are not supported here."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterSets(ABC):
    """The parameter sets of a stream, and how MP4 describes them."""

    may_change: bool = False
    """Whether they may change in the stream; keyframes then carry the new ones."""

    @property
    @abstractmethod
    def entry(self) -> str:
        """The kind of sample entry in MP4, which depends on whether they may change."""

    @property
    @abstractmethod
    def codec(self) -> str:
        """The codec string of RFC 6381."""

    @property
    @abstractmethod
    def configuration_kind(self) -> str:
        """The type of the box with the decoder configuration record."""

    @property
    @abstractmethod
    def configuration(self) -> bytes:
        """The decoder configuration record (ISO/IEC 14496-15)."""
