"""Writes a mid-gray VP8 keyframe, for viewers who may not see the cameras' pictures.

Every macroblock has DC prediction and no residual (RFC 6386, 12.2): the first one, without neighbors, is
gray, and so are the others.
"""

from __future__ import annotations

import struct
from functools import lru_cache

from server.media.vp8.repeat_frame import BLOCK, NO_TOKENS, RARE, frame_header

_HEADER_BITS = (
    (1, 0),  # color_space
    (1, 0),  # clamping_type
    (1, 0),  # segmentation_enabled
    (1, 0),  # filter_type
    (6, 0),  # loop_filter_level: none
    (3, 0),  # sharpness_level
    (1, 0),  # loop_filter_adj_enable
    (2, 0),  # log2_nbr_of_dct_partitions
    (7, 0),  # y_ac_qi
    (5, 0),  # no other quantizers
    (1, 1),  # refresh_entropy_probs
)
"""Number of bits and their value, up to the token probabilities (9.2 to 9.6, 9.11)."""
_DC_LUMA = ((1, 145), (0, 156), (0, 163))
"""DC_PRED as a keyframe's luma mode, each bit with its probability (11.2)."""
_DC_CHROMA = (0, 142)
_KEY_HEAD = struct.Struct("<3s3sHH")
_START = b"\x9d\x01\x2a"


@lru_cache(maxsize=4)
def gray_frame(width: int, height: int) -> bytes:
    """Return a gray keyframe of this size in pixels."""
    bits = frame_header(_HEADER_BITS)
    bits.number(8, RARE)  # prob_skip_false
    for _ in range(-(-width // BLOCK) * -(-height // BLOCK)):
        bits.put(1, RARE)  # mb_skip_coeff
        for bit, probability in _DC_LUMA:
            bits.put(bit, probability)
        bits.put(*_DC_CHROMA)
    first = bits.to_bytes()
    # A keyframe, version 0, shown; then the size of the first partition (9.1).
    tag = (1 << 4 | len(first) << 5).to_bytes(3, "little")
    return _KEY_HEAD.pack(tag, _START, width, height) + first + NO_TOKENS
