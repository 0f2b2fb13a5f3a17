"""Writes a VP8 frame that repeats the previous one, to fill a gap in a stream.

It is an inter frame in which every macroblock is copied from the same place of the previous frame, without
residual (RFC 6386, 9 and 19). It leaves the decoder's state as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

BLOCK = 16
"""The side of a macroblock in pixels."""
_HEADER_BITS = (
    (1, 0),  # segmentation_enabled
    (1, 0),  # filter_type
    (6, 0),  # loop_filter_level: none
    (3, 0),  # sharpness_level
    (1, 0),  # loop_filter_adj_enable
    (2, 0),  # log2_nbr_of_dct_partitions
    (7, 0),  # y_ac_qi
    (5, 0),  # no other quantizers
    (2, 0),  # refresh_golden_frame, refresh_alternate_frame
    (4, 0),  # copy_buffer_to_golden, copy_buffer_to_arf
    (2, 0),  # sign_bias_golden, sign_bias_alternate
    (1, 0),  # refresh_entropy_probs
    (1, 0),  # refresh_last
)
"""Number of bits and their value, up to the token probabilities (9.3 to 9.8)."""
RARE, OFTEN = 1, 255
"""Probabilities, out of 256, that a bit is 0."""
_ZERO_MV = {0: 7, 2: 135, 5: 234}
"""The probability of a block without motion, by its still neighbors; near ones count twice (8.3.3)."""
NO_TOKENS = bytes(4)
"""The second partition; decoders read nothing of it, but some reject an empty one."""

# The probabilities that token probabilities are not updated (13.4): a line per plane and band, with the first
# numbers of its three contexts; the remaining ones, up to the eleventh, are 255.
_COEFFICIENT_UPDATES = """
,,
176 246,223 241 252,249 253 253
255 244 252,234 254 254,253
255 246 254,239 253 254,254 255 254
255 248 254,251 255 254,
255 253 254,251 254 254,254 255 254
255 254 253 255 254,250 255 254 255 254,254
,,
217,225 252 241 253 255 255 254,234 250 241 250 253 255 253 254
255 254,223 254 254,238 253 254 254
255 248 254,249 254,
255 253,247 254,
255 253 254,252,
255 254 254,253,
255 254 253,250,254
,,
186 251 250,234 251 244 254,251 251 243 253 254 255 254
255 253 254,236 253 254,251 253 253 254 254
255 254 254,254 254 254,
255 254,254 254,254
,254,
,,
,,
,,
248,250 254 252 254,248 254 249 253
255 253 253,246 253 253,252 254 251 254 254
255 254 252,248 254 253,253 255 254 254
255 251 254,245 251 254,253 253 254
255 251 253,252 253 254,255 254
255 252,249 255 254,255 255 254
255 255 253,250,
,254,
"""
_PER_CONTEXT = 11
_PADDING_BITS = 32
_MOTION_UPDATES = (
    *(237, 246, 253, 253, 254, 254, 254, 254, 254, 254, 254, 254, 254, 254, 250, 250, 252, 254, 254),
    *(231, 243, 245, 253, 254, 254, 254, 254, 254, 254, 254, 254, 254, 254, 251, 251, 254, 254, 254),
)
"""The probabilities that motion vector probabilities are not updated (17.2)."""


@lru_cache(maxsize=4)
def repeat_frame(width: int, height: int) -> bytes:
    """Return a frame of this size in pixels that shows the previous one again."""
    bits = frame_header(_HEADER_BITS)
    for probability in (RARE, RARE, OFTEN, OFTEN):  # prob_skip_false, _intra, _last, _gf
        bits.number(8, probability)
    bits.number(2, 0)  # the probabilities of intra modes stay
    for probability in _MOTION_UPDATES:
        bits.put(0, probability)
    for row in range(-(-height // BLOCK)):
        for column in range(-(-width // BLOCK)):
            bits.put(1, RARE)  # mb_skip_coeff
            bits.put(1, RARE)  # is_inter_mb
            bits.put(0, OFTEN)  # mb_ref_frame_sel1: the last frame
            near = 2 * (row > 0) + 2 * (column > 0) + (row > 0 and column > 0)
            bits.put(0, _ZERO_MV[near])
    first = bits.to_bytes()
    # Not a keyframe, version 0, shown; then the size of the first partition (9.1).
    return (1 | 1 << 4 | len(first) << 5).to_bytes(3, "little") + first + NO_TOKENS


def frame_header(fields: Sequence[tuple[int, int]]) -> BoolWriter:
    """Write a frame header up to mb_no_skip_coeff; the token probabilities stay as they are.

    ``fields``: (number of bits, value) of each.
    """
    bits = BoolWriter()
    for count, value in fields:
        bits.number(count, value)
    for probability in _coefficient_updates():
        bits.put(0, probability)
    bits.number(1, 1)  # mb_no_skip_coeff
    return bits


def _coefficient_updates() -> list[int]:
    """Return the probabilities that token probabilities are not updated, in order."""
    lines = _COEFFICIENT_UPDATES.strip().splitlines()
    contexts = [context.split() for line in lines for context in line.split(",")]
    return [
        int(number) for context in contexts for number in (context + ["255"] * _PER_CONTEXT)[:_PER_CONTEXT]
    ]


class BoolWriter:
    """The boolean entropy encoder (RFC 6386, 7.3), on integers of any length."""

    def __init__(self) -> None:
        self._bottom, self._range, self._bits = 0, 255, 0

    def put(self, bit: int, probability: int) -> None:
        """Write a bit; ``probability``, out of 256, is that of 0."""
        split = 1 + ((self._range - 1) * probability >> 8)
        if bit:
            self._bottom += split
            self._range -= split
        else:
            self._range = split
        shift = 8 - self._range.bit_length()
        self._range <<= shift
        self._bottom <<= shift
        self._bits += shift

    def number(self, bits: int, value: int) -> None:
        """Write an unsigned number in ``bits`` bits, the highest first."""
        for place in reversed(range(bits)):
            self.put(value >> place & 1, 128)

    def to_bytes(self) -> bytes:
        """Return the bytes, padded: decoders read ahead, and some treat the end of the data as damage."""
        self.number(_PADDING_BITS, 0)
        bits = self._bits + 8
        spare = -bits % 8
        return (self._bottom << spare).to_bytes((bits + spare) // 8, "big")
