"""The arithmetic encoder of CABAC, equal in H.264 and H.265 (ITU-T H.264, 9.3.4.2; ITU-T H.265, 9.3.4.3)."""

from __future__ import annotations

from server.media.bitstream import BitWriter

_STATES = 64
# rangeTabLPS (H.264, table 9-44), by pStateIdx.
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
# transIdxLPS (H.264, table 9-45).
_NEXT_STATE_LPS = (
    0, 0, 1, 2, 2, 4, 4, 5, 6, 7, 8, 9, 9, 11, 11, 12, 13, 13, 15, 15, 16, 16, 18, 18, 19, 19, 21, 21, 22, 22,
    23, 24, 24, 25, 26, 26, 27, 27, 28, 29, 29, 30, 30, 30, 31, 32, 32, 33, 33, 33, 34, 34, 35, 35, 35, 36,
    36, 36, 37, 37, 37, 38, 38, 63,
)  # fmt: skip
_LAST_STATE = 62
_ONE, _HALF, _QUARTER = 0x400, 0x200, 0x100


class ContextModel:
    """The probability model of one kind of bit: its more probable value, and the state."""

    __slots__ = ("likely", "state")

    def __init__(self, start: int) -> None:
        """Initialize from preCtxState, which is clipped to its range."""
        start = min(max(1, start), 2 * _STATES - 2)
        self.likely = int(start >= _STATES)
        self.state = start - _STATES if self.likely else _STATES - 1 - start

    def copy(self) -> ContextModel:
        """Return a model with the same state."""
        model = ContextModel(1)
        model.likely, model.state = self.likely, self.state
        return model


class ArithmeticEncoder:
    """Writes bits, arithmetically encoded."""

    def __init__(self, bits: BitWriter) -> None:
        self._bits = bits
        self._low, self._range = 0, 510
        self._first, self._outstanding = True, 0

    def put(self, bit: int, context: ContextModel) -> None:
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

    def bypass(self, bit: int) -> None:
        """Encode a bit of which both values are equally probable."""
        self._low <<= 1
        if bit:
            self._low += self._range
        if self._low >= _ONE:
            self._put(1)
            self._low -= _ONE
        elif self._low < _HALF:
            self._put(0)
        else:
            self._low -= _HALF
            self._outstanding += 1

    def terminate(self, *, end: bool) -> None:
        """Encode a bit that ends the data if it is one, as the last bit written; so does a PCM block."""
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
