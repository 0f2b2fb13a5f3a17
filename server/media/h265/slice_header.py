"""Slice headers of H.265 (ITU-T H.265, 7.3.6): reads a picture's place and references, writes pictures."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

from server.media.bitstream import BitReader, BitWriter, escape_payload, unescape_payload
from server.media.h265.nal import HEAD_BYTES, is_idr, is_irap, is_picture
from server.media.h265.reference_sets import ReferenceSet, read_reference_set, write_reference_set
from server.media.h265.slice_data import SLICE_QP
from server.media.h265.stream_syntax import StreamSyntax
from server.media.nal_units import split_sample

_READ_BYTES = 128
"""Bytes of a slice that contain the fields that are read."""
_P, _I = 1, 2
"""slice_type."""
_TEMPORAL_ID = 1
"""nuh_temporal_id_plus1 of the lowest sub-layer."""
_MAX_ROUNDS = 8
_ESCAPED = re.compile(b"\x00\x00\x03")


@dataclass(frozen=True, slots=True)
class PictureOrder:
    """Where a picture is in its GOP, and what it refers to."""

    count: int
    """The lower bits of its picture order count."""
    references: ReferenceSet = ()
    long_term: bool = False
    """Whether it also refers to long-term pictures."""


def read_picture_order(sample: bytes, syntax: StreamSyntax) -> PictureOrder:
    """Return the order of the picture in a sample, length-prefixed NAL units.

    Raises:
        ValueError: it contains no picture, or a damaged one.
    """
    unit = next((unit for unit in split_sample(sample) if is_picture(unit)), None)
    if unit is None:
        raise ValueError("the sample contains no picture")
    if is_idr(unit):
        return PictureOrder(0)
    bits = BitReader(unescape_payload(unit[:_READ_BYTES], HEAD_BYTES))
    sequence, picture = syntax.sequence, syntax.picture
    if not bits.u(1):
        raise ValueError("the first slice of the picture is missing")
    bits.u(int(is_irap(unit)))
    if bits.ue() != picture.pps_id:
        raise ValueError("a picture of other parameter sets")
    bits.u(picture.extra_bits)
    bits.ue()
    bits.u(int(picture.output_flag))
    count, sets = bits.u(sequence.order_bits), sequence.reference_sets
    if not bits.u(1):
        references = read_reference_set(bits, sets, in_slice=True)
    else:
        place = bits.u((len(sets) - 1).bit_length() if len(sets) > 1 else 0)
        if place >= len(sets):
            raise ValueError("a reference picture set that is not in the SPS")
        references = sets[place]
    long_term = False
    if sequence.long_term:
        in_sps = bits.ue() if sequence.long_term_in_sps else 0
        long_term = in_sps + bits.ue() > 0
    return PictureOrder(count, references, long_term)


def write_repeat(
    syntax: StreamSyntax, kind: int, count: int, references: ReferenceSet, substreams: Sequence[bytes]
) -> bytes:
    """Return the NAL unit of a P picture that has one active reference, and no motion but zero.

    ``kind`` is its nal_unit_type, ``count`` the lower bits of its picture order count. The nearest of
    ``references`` is the only one that is used.
    """
    sequence, picture, bits = syntax.sequence, syntax.picture, BitWriter()
    _begin(bits, syntax, _P)
    bits.u(sequence.order_bits, count % (1 << sequence.order_bits))
    bits.u(1, 0)
    write_reference_set(bits, len(sequence.reference_sets), references)
    if sequence.long_term:
        if sequence.long_term_in_sps:
            bits.ue(0)
        bits.ue(0)
    if sequence.temporal_motion:
        bits.u(1, 0)
    _write_offset_flags(bits, syntax)
    bits.u(1, 1)  # num_ref_idx_active_override_flag: one reference
    bits.ue(0)
    if picture.cabac_init:
        bits.u(1, 0)
    if picture.weighted:
        bits.ue(0)
        bits.se(0)
        bits.u(2, 0)  # no weights
    bits.ue(4)  # five_minus_max_num_merge_cand: one candidate
    return _finish(bits, syntax, kind, substreams)


def write_intra(syntax: StreamSyntax, kind: int, substreams: Sequence[bytes]) -> bytes:
    """Return the NAL unit of an IDR picture, ``kind`` being its nal_unit_type."""
    bits = BitWriter()
    _begin(bits, syntax, _I, is_irap_picture=True)
    _write_offset_flags(bits, syntax)
    return _finish(bits, syntax, kind, substreams)


def _begin(bits: BitWriter, syntax: StreamSyntax, slice_type: int, *, is_irap_picture: bool = False) -> None:
    bits.u(1, 1)
    if is_irap_picture:
        bits.u(1, 0)  # no_output_of_prior_pics_flag
    bits.ue(syntax.picture.pps_id)
    bits.copy("0" * syntax.picture.extra_bits)
    bits.ue(slice_type)
    if syntax.picture.output_flag:
        bits.u(1, 1)


def _write_offset_flags(bits: BitWriter, syntax: StreamSyntax) -> None:
    if syntax.sequence.sample_adaptive_offset:
        bits.u(2, 0)  # neither luma nor chroma


def _finish(bits: BitWriter, syntax: StreamSyntax, kind: int, substreams: Sequence[bytes]) -> bytes:
    """Write the end of the header, and return the NAL unit."""
    picture = syntax.picture
    bits.se(SLICE_QP - picture.init_qp)
    if picture.chroma_offsets:
        bits.se(0)
        bits.se(0)
    deblocking_off = picture.deblocking_off
    if picture.deblocking_override:
        bits.u(2, 3)  # the deblocking filter is off in this slice
        deblocking_off = True
    if picture.filter_across_slices and not deblocking_off:
        bits.u(1, 0)
    head = bytes([kind << 1, _TEMPORAL_ID])
    sizes = [len(substream) for substream in substreams]
    for _ in range(_MAX_ROUNDS):
        header = _end_of_header(bits.text, syntax, sizes)
        unit = escape_payload(head, header + b"".join(substreams))
        escaped = _escaped_sizes(unit, len(header), [len(substream) for substream in substreams])
        if escaped == sizes:
            break
        sizes = escaped
    return unit


def _end_of_header(text: str, syntax: StreamSyntax, sizes: Sequence[int]) -> bytes:
    """Return a slice header with the entry points of substreams of these sizes."""
    bits = BitWriter()
    bits.copy(text)
    if syntax.picture.wavefront:
        bits.ue(len(sizes) - 1)
        if len(sizes) > 1:
            width = max(size - 1 for size in sizes[:-1]).bit_length() or 1
            bits.ue(width - 1)
            for size in sizes[:-1]:
                bits.u(width, size - 1)
    if syntax.picture.header_extension:
        bits.ue(0)
    bits.u(1, 1)
    bits.align(0)
    return bits.to_bytes()


def _escaped_sizes(unit: bytes, header_bytes: int, sizes: Sequence[int]) -> list[int]:
    """Return the sizes of the substreams in a unit with their emulation prevention bytes (7.4.7.1)."""
    ends = list(accumulate(sizes, initial=header_bytes))
    escaped = list(sizes)
    for number, match in enumerate(_ESCAPED.finditer(unit)):
        before = match.end() - 1 - HEAD_BYTES - number  # the byte of the payload that it stands before
        if before >= header_bytes:
            escaped[bisect_right(ends, before) - 1] += 1
    return escaped
