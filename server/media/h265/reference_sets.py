"""Short-term reference picture sets, in the SPS and in slice headers (ITU-T H.265, 7.3.7 and 7.4.8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from server.media.bitstream import BitReader, BitWriter

_MAX_PICTURES = 16
_MAX_DISTANCE = 1 << 15


@dataclass(frozen=True, slots=True)
class Reference:
    """A picture that a decoder keeps, before (negative) or after the one that is decoded."""

    distance: int
    """Its picture order count less that of the picture that is decoded."""
    used: bool
    """Whether that picture itself may refer to it; otherwise only later ones."""


ReferenceSet = tuple[Reference, ...]
"""The earlier pictures from the nearest on, then the later ones likewise."""


def read_reference_set(bits: BitReader, before: Sequence[ReferenceSet], *, in_slice: bool) -> ReferenceSet:
    """Read st_ref_pic_set; ``before`` are the sets of the SPS that precede it, all of them in a slice.

    Raises:
        ValueError: it is damaged.
    """
    if before and bits.u(1):
        return _read_predicted(bits, before, in_slice=in_slice)
    earlier, later = bits.ue(), bits.ue()
    if earlier + later > _MAX_PICTURES:
        raise ValueError("more references than a decoder keeps")
    return (*_read_side(bits, earlier, -1), *_read_side(bits, later, 1))


def write_reference_set(bits: BitWriter, sets_in_sps: int, references: ReferenceSet) -> None:
    """Write st_ref_pic_set of a slice header; all references are earlier."""
    if sets_in_sps:
        bits.u(1, 0)  # not predicted from those of the SPS
    bits.ue(len(references))
    bits.ue(0)
    distance = 0
    for reference in references:
        bits.ue(distance - reference.distance - 1)
        bits.u(1, int(reference.used))
        distance = reference.distance


def _read_side(bits: BitReader, count: int, sign: int) -> list[Reference]:
    references, distance = [], 0
    for _ in range(count):
        distance += sign * (bits.ue() + 1)
        references.append(_reference(distance, used=bool(bits.u(1))))
    return references


def _read_predicted(bits: BitReader, before: Sequence[ReferenceSet], *, in_slice: bool) -> ReferenceSet:
    """Read a set that is another one, moved, with pictures left out (7.4.8, equations 7-61 and 7-62)."""
    back = bits.ue() + 1 if in_slice else 1
    if back > len(before):
        raise ValueError("a reference picture set that is predicted from none")
    sign = bits.u(1)
    shift = (1 - 2 * sign) * (bits.ue() + 1)
    other = before[-back]
    kept = list[Reference]()
    for place in range(len(other) + 1):
        used = bool(bits.u(1))
        if used or bits.u(1):
            distance = shift + (other[place].distance if place < len(other) else 0)
            kept.append(_reference(distance, used=used))
    if len(kept) > _MAX_PICTURES:
        raise ValueError("more references than a decoder keeps")
    earlier = sorted((one for one in kept if one.distance < 0), key=lambda one: -one.distance)
    later = sorted((one for one in kept if one.distance > 0), key=lambda one: one.distance)
    return (*earlier, *later)


def _reference(distance: int, *, used: bool) -> Reference:
    if abs(distance) > _MAX_DISTANCE:
        raise ValueError("a reference too far away")
    return Reference(distance, used)
