"""What the parameter sets say about a stream's slices (ITU-T H.265, 7.3.2.2, 7.3.2.3 and 7.3.3)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from server.media.bitstream import BitReader, unescape_payload
from server.media.h265.nal import HEAD_BYTES
from server.media.h265.reference_sets import ReferenceSet, read_reference_set
from server.media.parameter_sets import UnsupportedParametersError

_MAIN, _MAIN_STILL = 1, 3
"""general_profile_idc: Main, Main 10 and Main Still Picture; other profiles have more syntax."""
_MAX_LUMA_SAMPLES, _MAX_SIDE = 35_651_584, 16_888
"""Of the highest level (table A.8): bounds the time to write a picture."""
_MAX_CTB, _MIN_CTB, _MAX_TB = 6, 4, 5
_MAX_DEPTH = 10
_MAX_SETS, _MAX_LONG_TERM = 64, 32


@dataclass(frozen=True, slots=True)
class BlockSizes:
    """Sizes of blocks, as binary logarithms.

    Attributes:
        min_cb, ctb: the smallest coding block, and the coding tree block.
        min_tb, max_tb: the smallest and the largest transform block.
        intra_depth: max_transform_hierarchy_depth_intra.
    """

    min_cb: int
    ctb: int
    min_tb: int
    max_tb: int
    intra_depth: int


@dataclass(frozen=True, slots=True)
class SequenceSyntax:
    """Fields of the sequence parameter set.

    Attributes:
        width, height: of a picture before cropping, in samples.
        order_bits: bits of slice_pic_order_cnt_lsb.
        reorders: whether pictures may be shown in another order than decoded.
        kept: pictures besides the current one that a decoder keeps.
        pcm: the smallest and largest PCM block, as binary logarithms; None: there are none.
    """

    width: int
    height: int
    bit_depth: int
    order_bits: int
    kept: int
    reorders: bool
    blocks: BlockSizes
    sample_adaptive_offset: bool
    pcm: tuple[int, int] | None
    reference_sets: tuple[ReferenceSet, ...]
    long_term: bool
    long_term_in_sps: int
    temporal_motion: bool


@dataclass(frozen=True, slots=True)
class PictureSyntax:
    """Fields of the picture parameter set that slice headers and data depend on."""

    pps_id: int
    output_flag: bool
    extra_bits: int
    cabac_init: bool
    init_qp: int
    chroma_offsets: bool
    weighted: bool
    lossless_blocks: bool
    """transquant_bypass_enabled_flag."""
    wavefront: bool
    """entropy_coding_sync_enabled_flag: each row of blocks is a substream."""
    filter_across_slices: bool
    deblocking_override: bool
    deblocking_off: bool
    header_extension: bool


@dataclass(frozen=True, slots=True)
class StreamSyntax:
    """The syntax of a stream's slices."""

    sequence: SequenceSyntax
    picture: PictureSyntax


@lru_cache(maxsize=16)
def parse_stream_syntax(sps: bytes, pps: bytes) -> StreamSyntax:
    """Parse the parameter sets of a stream.

    Raises:
        UnsupportedParametersError: they are damaged, or use features that are not supported here.
    """
    try:
        return StreamSyntax(
            _read_sps(BitReader(unescape_payload(sps, HEAD_BYTES))),
            _read_pps(BitReader(unescape_payload(pps, HEAD_BYTES))),
        )
    except ValueError as error:
        raise UnsupportedParametersError(str(error)) from error


def _read_sps(bits: BitReader) -> SequenceSyntax:
    bits.u(4)
    sub_layers = bits.u(3) + 1
    bits.u(1)
    _read_profile(bits, sub_layers)
    bits.ue()
    if bits.ue() != 1:
        raise ValueError("not 4:2:0")
    width, height = bits.ue(), bits.ue()
    if not 0 < width * height <= _MAX_LUMA_SAMPLES or max(width, height) > _MAX_SIDE:
        raise ValueError("beyond the highest level")
    if bits.u(1):
        _skip(bits, 4)
    bit_depth, chroma_depth = bits.ue() + 8, bits.ue() + 8
    if bit_depth != chroma_depth or bit_depth > _MAX_DEPTH:
        raise ValueError("unusual bit depths")
    order_bits = _limited(bits.ue() + 4, 16)
    kept = reordered = 0
    for _ in range(sub_layers if bits.u(1) else 1):
        kept, reordered, _ = bits.ue(), bits.ue(), bits.ue()
    blocks = _read_blocks(bits)
    if width % (1 << blocks.min_cb) or height % (1 << blocks.min_cb):
        raise ValueError("impossible sizes of blocks")
    if bits.u(1) and bits.u(1):
        _skip_scaling_lists(bits)
    bits.u(1)
    sample_adaptive_offset = bool(bits.u(1))
    pcm = _read_pcm(bits) if bits.u(1) else None
    reference_sets: list[ReferenceSet] = []
    for _ in range(_limited(bits.ue(), _MAX_SETS)):
        reference_sets.append(read_reference_set(bits, reference_sets, in_slice=False))
    long_term, long_term_in_sps = bool(bits.u(1)), 0
    if long_term:
        long_term_in_sps = _limited(bits.ue(), _MAX_LONG_TERM)
        bits.u(long_term_in_sps * (order_bits + 1))
    return SequenceSyntax(
        width=width,
        height=height,
        bit_depth=bit_depth,
        order_bits=order_bits,
        kept=kept,
        reorders=reordered > 0,
        blocks=blocks,
        sample_adaptive_offset=sample_adaptive_offset,
        pcm=pcm,
        reference_sets=tuple(reference_sets),
        long_term=long_term,
        long_term_in_sps=long_term_in_sps,
        temporal_motion=bool(bits.u(1)),
    )


def _read_blocks(bits: BitReader) -> BlockSizes:
    min_cb = _limited(bits.ue() + 3, _MAX_CTB)
    ctb = _limited(min_cb + bits.ue(), _MAX_CTB)
    min_tb = bits.ue() + 2
    max_tb = min_tb + bits.ue()
    bits.ue()
    if ctb < _MIN_CTB or min_tb >= min_cb or max_tb > min(ctb, _MAX_TB):
        raise ValueError("impossible sizes of blocks")
    return BlockSizes(min_cb, ctb, min_tb, max_tb, bits.ue())


def _read_pcm(bits: BitReader) -> tuple[int, int]:
    bits.u(8)
    smallest = bits.ue() + 3
    largest = smallest + bits.ue()
    bits.u(1)
    return smallest, largest


def _limited(value: int, most: int) -> int:
    if value > most:
        raise ValueError("damaged")
    return value


def _skip(bits: BitReader, numbers: int) -> None:
    for _ in range(numbers):
        bits.ue()


def _read_profile(bits: BitReader, sub_layers: int) -> None:
    """Read profile_tier_level.

    Raises:
        ValueError: slices of this profile have syntax that is not supported here.
    """
    profile = bits.u(8) & 0x1F
    compatible = bits.u(32)
    if not _MAIN <= profile <= _MAIN_STILL and not compatible >> 28 & 0b110:
        raise ValueError("neither Main nor Main 10 profile")
    bits.u(48 + 8)
    present = [(bits.u(1), bits.u(1)) for _ in range(sub_layers - 1)]
    if present:
        bits.u(2 * (8 - len(present)))
    for has_profile, has_level in present:
        bits.u(88 * has_profile + 8 * has_level)


def _skip_scaling_lists(bits: BitReader) -> None:
    """Read scaling_list_data (7.3.4)."""
    for size in range(4):
        for _ in range(6 if size < 3 else 2):  # noqa: PLR2004 — the largest blocks have two matrices
            if not bits.u(1):
                bits.ue()
                continue
            if size > 1:
                bits.se()
            for _ in range(min(64, 1 << 4 + 2 * size)):
                bits.se()


def _read_pps(bits: BitReader) -> PictureSyntax:
    pps_id = bits.ue()
    bits.ue()
    bits.u(1)
    output_flag = bool(bits.u(1))
    extra_bits = bits.u(3)
    bits.u(1)
    cabac_init = bool(bits.u(1))
    bits.ue(), bits.ue()
    init_qp = 26 + bits.se()
    bits.u(2)
    if bits.u(1):
        bits.ue()
    bits.se(), bits.se()
    chroma_offsets, weighted = bool(bits.u(1)), bool(bits.u(1))
    bits.u(1)
    lossless_blocks, tiles, wavefront = (bool(bits.u(1)) for _ in range(3))
    if tiles:
        raise ValueError("tiles")
    filter_across_slices = bool(bits.u(1))
    deblocking_override = deblocking_off = False
    if bits.u(1):
        deblocking_override, deblocking_off = bool(bits.u(1)), bool(bits.u(1))
        if not deblocking_off:
            bits.se(), bits.se()
    if bits.u(1):
        _skip_scaling_lists(bits)
    bits.u(1)
    bits.ue()
    return PictureSyntax(
        pps_id=pps_id,
        output_flag=output_flag,
        extra_bits=extra_bits,
        cabac_init=cabac_init,
        init_qp=init_qp,
        chroma_offsets=chroma_offsets,
        weighted=weighted,
        lossless_blocks=lossless_blocks,
        wavefront=wavefront,
        filter_across_slices=filter_across_slices,
        deblocking_override=deblocking_override,
        deblocking_off=deblocking_off,
        header_extension=bool(bits.u(1)),
    )
