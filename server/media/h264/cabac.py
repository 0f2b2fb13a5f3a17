"""CABAC encoder (ITU-T H.264, 9.3.4) for slices of skipped macroblocks, or of gray ones."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from server.media.h264.bitstream import BitWriter

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
_STATES = 64
# rangeTabLPS (table 9-44), by pStateIdx.
_RANGE_LPS = (
    (128, 176, 208, 240), (128, 167, 197, 227), (128, 158, 187, 216), (123, 150, 178, 205),
    (116, 142, 169, 195), (111, 135, 160, 185), (105, 128, 152, 175), (100, 122, 144, 166),
    (95, 116, 137, 158), (90, 110, 130, 150), (85, 104, 123, 142), (81, 99, 117, 135),
    (77, 94, 111, 128), (73, 89, 105, 122), (69, 85, 100, 116), (66, 80, 95, 110),
    (62, 76, 90, 104), (59, 72, 86, 99), (56, 69, 81, 94), (53, 65, 77, 89),
    (51, 62, 73, 85), (48, 59, 69, 80), (46, 56, 66, 76), (43, 53, 63, 72),
    (41, 50, 59, 69), (39, 48, 56, 65), (37, 45, 54, 62), (35, 43, 51, 59),
    (33, 41, 48, 56), (32, 39, 46, 53), (30, 37, 43, 50), (29, 35, 41, 48),
    (27, 33, 39, 45), (26, 31, 37, 43), (24, 30, 35, 41), (23, 28, 33, 39),
    (22, 27, 32, 37), (21, 26, 30, 35), (20, 24, 29, 33), (19, 23, 27, 31),
    (18, 22, 26, 30), (17, 21, 25, 28), (16, 20, 23, 27), (15, 19, 22, 25),
    (14, 18, 21, 24), (14, 17, 20, 23), (13, 16, 19, 22), (12, 15, 18, 21),
    (12, 14, 17, 20), (11, 14, 16, 19), (11, 13, 15, 18), (10, 12, 15, 17),
    (10, 12, 14, 16), (9, 11, 13, 15), (9, 11, 12, 14), (8, 10, 12, 14),
    (8, 9, 11, 13), (7, 9, 11, 12), (7, 9, 10, 12), (7, 8, 10, 11),
    (6, 8, 9, 11), (6, 7, 9, 10), (6, 7, 8, 9), (2, 2, 2, 2),
)  # fmt: skip
# transIdxLPS (table 9-45).
_NEXT_STATE_LPS = (
    0, 0, 1, 2, 2, 4, 4, 5, 6, 7, 8, 9, 9, 11, 11, 12, 13, 13, 15, 15, 16, 16, 18, 18, 19, 19, 21, 21, 22, 22,
    23, 24, 24, 25, 26, 26, 27, 27, 28, 29, 29, 30, 30, 30, 31, 32, 32, 33, 33, 33, 34, 34, 35, 35, 35, 36,
    36, 36, 37, 37, 37, 38, 38, 63,
)  # fmt: skip
_LAST_STATE = 62
_HALF, _QUARTER = 0x200, 0x100


@lru_cache(maxsize=4)
def skipped_slice(macroblocks: int) -> str:
    """Return the slice data of skipped macroblocks, with the end of the slice and rbsp_stop_one_bit.

    It is the same in every picture of a size, and cached: coding takes milliseconds.
    """
    bits = BitWriter()
    coder = _Coder(bits)
    skipped = _Context(_SKIPPED)  # neighbors are skipped, too: there is only one context
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
    coder = _Coder(bits)
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


class _Context:
    """The probability model of one kind of bit: its more probable value, and the state."""

    __slots__ = ("likely", "state")

    def __init__(self, begin: tuple[int, int]) -> None:
        """Initialize from m and n of the tables, at :data:`SLICE_QP` (9.3.1.1)."""
        start = min(max(1, (begin[0] * SLICE_QP >> 4) + begin[1]), 2 * _STATES - 2)
        self.likely = int(start >= _STATES)
        self.state = start - _STATES if self.likely else _STATES - 1 - start


def _contexts(begin: Sequence[tuple[int, int]]) -> list[_Context]:
    return [_Context(slope_and_offset) for slope_and_offset in begin]


class _Coder:
    """The arithmetic encoder of 9.3.4.2."""

    def __init__(self, bits: BitWriter) -> None:
        self._bits = bits
        self._low, self._range = 0, 510
        self._first, self._outstanding = True, 0

    def put(self, bit: int, context: _Context) -> None:
        """Encode a bit, and update its context."""
        lps_range = _RANGE_LPS[context.state][self._range >> 6 & 3]
        self._range -= lps_range
        if bit == context.likely:
            context.state = min(context.state + 1, _LAST_STATE)
        else:
            self._low += self._range
            self._range = lps_range
            if context.state == 0:
                context.likely = 1 - context.likely
            context.state = _NEXT_STATE_LPS[context.state]
        self._renormalize()

    def terminate(self, *, end: bool) -> None:
        """Encode end_of_slice_flag, or that a macroblock is not I_PCM."""
        self._range -= 2
        if not end:
            self._renormalize()
            return
        self._low += self._range
        self._range = 2
        self._renormalize()
        self._put(self._low >> 9 & 1)
        self._bits.u(2, self._low >> 7 & 3 | 1)

    def _renormalize(self) -> None:
        while self._range < _QUARTER:
            if self._low < _QUARTER:
                self._put(0)
            elif self._low >= _HALF:
                self._low -= _HALF
                self._put(1)
            else:
                self._low -= _QUARTER
                self._outstanding += 1
            self._range <<= 1
            self._low <<= 1

    def _put(self, bit: int) -> None:
        if self._first:
            self._first = False
        else:
            self._bits.u(1, bit)
        while self._outstanding:
            self._bits.u(1, 1 - bit)
            self._outstanding -= 1
