"""Slice data in CABAC (ITU-T H.264, 9.3) of skipped macroblocks, or of gray ones."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from server.media.arithmetic_coder import ArithmeticEncoder, ContextModel
from server.media.bitstream import BitWriter

SLICE_QP = 51
"""The quantizer at which the initial context makes skipping most probable."""
_SKIPPED = (23, 33)
"""m and n of mb_skip_flag with cabac_init_idc 0 (table 9-13)."""
# m and n of an I slice: mb_type (table 9-12), mb_qp_delta, intra_chroma_pred_mode and coded_block_flag of the
# luma's DC (tables 9-17 and 9-18).
_MB_TYPE = ((20, -15), (2, 54), (3, 74))
"""By the number of I_16x16 neighbors, left and above."""
_LUMA_AC, _CHROMA, _MODE_HIGH, _MODE_LOW = (-28, 127), (-23, 104), (-1, 54), (7, 51)
_QP_DELTA, _CHROMA_MODE = (0, 41), (-9, 83)
_LUMA_DC = ((-17, 123), (-12, 115), (-16, 122), (-11, 115))
"""By 1 for no neighbor on the left, plus 2 for none above."""


@lru_cache(maxsize=4)
def skipped_slice(macroblocks: int) -> str:
    """Return the slice data of skipped macroblocks, with the end of the slice and rbsp_stop_one_bit.

    It is the same in every picture of a size, and cached: coding takes milliseconds.
    """
    bits = BitWriter()
    coder = ArithmeticEncoder(bits)
    skipped = _context(_SKIPPED)  # neighbors are skipped, too: there is only one context
    for left in range(macroblocks - 1, -1, -1):
        coder.put(1, skipped)
        coder.terminate(end=left == 0)
    return bits.text


@lru_cache(maxsize=4)
def gray_slice(width_mbs: int, height_mbs: int) -> str:
    """Return the slice data of an I slice of a mid-gray picture; sides in macroblocks.

    Every macroblock is I_16x16 with DC prediction and no residual: mid-gray where there are no neighbors, and
    thus everywhere (8.3.3.3).
    """
    bits = BitWriter()
    coder = ArithmeticEncoder(bits)
    mb_types, luma_dc = _contexts(_MB_TYPE), _contexts(_LUMA_DC)
    luma_ac, chroma, high, low = _contexts((_LUMA_AC, _CHROMA, _MODE_HIGH, _MODE_LOW))
    chroma_mode, delta = _contexts((_CHROMA_MODE, _QP_DELTA))
    for row in range(height_mbs):
        for column in range(width_mbs):
            coder.put(1, mb_types[(row > 0) + (column > 0)])
            coder.terminate(end=False)  # it is not I_PCM
            coder.put(0, luma_ac)
            coder.put(0, chroma)
            coder.put(1, high)
            coder.put(0, low)
            coder.put(0, chroma_mode)
            coder.put(0, delta)
            coder.put(0, luma_dc[(column == 0) + 2 * (row == 0)])
            coder.terminate(end=row == height_mbs - 1 and column == width_mbs - 1)
    return bits.text


def _context(begin: tuple[int, int]) -> ContextModel:
    """Return the context of m and n of the tables, at :data:`SLICE_QP` (9.3.1.1)."""
    return ContextModel((begin[0] * SLICE_QP >> 4) + begin[1])


def _contexts(begin: Sequence[tuple[int, int]]) -> list[ContextModel]:
    return [_context(slope_and_offset) for slope_and_offset in begin]
