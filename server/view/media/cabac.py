"""The one thing written in H.264's arithmetic code: a slice in which every macroblock is skipped (9.3.4)."""

from __future__ import annotations

from functools import lru_cache

from server.view.media.bits import BitWriter

SLICE_QP = 51
"""The quantiser at which being skipped is what the code thinks likeliest from the start."""
_STATE = 42
"""pStateIdx of mb_skip_flag at that quantiser with cabac_init_idc 0 (m 23, n 33, table 9-13); 1 is likely."""
_LAST_STATE = 62
# rangeTabLPS (table 9-44) from that state on: nothing unlikely is ever coded, so no lower one comes up.
_RANGE_LPS = (
    (16, 20, 23, 27), (15, 19, 22, 25), (14, 18, 21, 24), (14, 17, 20, 23), (13, 16, 19, 22),
    (12, 15, 18, 21), (12, 14, 17, 20), (11, 14, 16, 19), (11, 13, 15, 18), (10, 12, 15, 17),
    (10, 12, 14, 16), (9, 11, 13, 15), (9, 11, 12, 14), (8, 10, 12, 14), (8, 9, 11, 13),
    (7, 9, 11, 12), (7, 9, 10, 12), (7, 8, 10, 11), (6, 8, 9, 11), (6, 7, 9, 10),
    (6, 7, 8, 9),
)  # fmt: skip
_HALF, _QUARTER = 0x200, 0x100


@lru_cache(maxsize=4)
def skipped_slice(macroblocks: int) -> str:
    """Give so many skipped macroblocks, the slice's end and rbsp_stop_one_bit, as bits from a whole byte on.

    They are the same in every picture of a size; coding them takes milliseconds.
    """
    bits = BitWriter()
    coder = _Coder(bits)
    for left in range(macroblocks - 1, -1, -1):
        coder.skipped()
        coder.end_of_slice(end=left == 0)
    return bits.text


class _Coder:
    """The encoder of 9.3.4.2, as far as likely symbols and the end need it."""

    def __init__(self, bits: BitWriter) -> None:
        self._bits = bits
        self._low, self._range = 0, 510
        self._first, self._outstanding = True, 0
        self._state = _STATE

    def skipped(self) -> None:
        """Code mb_skip_flag 1, the likely value; neighbours are skipped too, so it has one context only."""
        self._range -= _RANGE_LPS[self._state - _STATE][self._range >> 6 & 3]
        self._state = min(self._state + 1, _LAST_STATE)
        self._renormalise()

    def end_of_slice(self, *, end: bool) -> None:
        """Code end_of_slice_flag."""
        self._range -= 2
        if not end:
            self._renormalise()
            return
        self._low += self._range
        self._range = 2
        self._renormalise()
        self._put(self._low >> 9 & 1)
        self._bits.u(2, self._low >> 7 & 3 | 1)

    def _renormalise(self) -> None:
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
