"""Writes a mid-gray H.264 keyframe, for viewers who may not see the cameras' pictures.

Every macroblock has DC prediction and no residual (ITU-T H.264, 8.3.3.3), which is gray in all formats. The
picture carries the parameter sets of its stream, so that a decoder accepts it like a camera's keyframe. It is
written once per parameter sets, and has at most a byte per macroblock.
"""

from __future__ import annotations

from functools import lru_cache

from server.media.bitstream import BitWriter, escape_payload
from server.media.h264 import cabac
from server.media.h264.annexb import NAL_IDR, H264ParameterSets, join_sample
from server.media.h264.repeat_picture import parse_slice_header_format

_SLICE_I = 7
"""slice_type of a picture all of whose slices are I."""
_IDR = 0x60 | NAL_IDR
"""NAL header with nal_ref_idc 3."""
_GRAY_MACROBLOCK = "00100111"
"""mb_type I_16x16_2_0_0, intra_chroma_pred_mode DC, mb_qp_delta 0, and no coefficients (7.3.5)."""


@lru_cache(maxsize=16)
def gray_picture(parameters: H264ParameterSets, idr_pic_id: int) -> bytes:
    """Return the sample of a gray keyframe: length-prefixed NAL units, parameter sets first.

    ``idr_pic_id`` differs between two keyframes in a row (7.4.3).

    Raises:
        UnsupportedParametersError: the parameter sets are damaged, or use rare features.
    """
    head = parse_slice_header_format(parameters)
    bits = BitWriter()
    for value in (0, _SLICE_I, head.pps_id):
        bits.ue(value)
    bits.u(head.frame_num_bits, 0)
    bits.ue(idr_pic_id)
    if head.order_bits:
        bits.u(head.order_bits, 0)
        if head.order_of_fields:
            bits.se(0)
    if head.redundant:
        bits.ue(0)
    bits.u(2, 0)  # no_output_of_prior_pics_flag, long_term_reference_flag
    bits.se(cabac.SLICE_QP - head.init_qp)
    if head.deblocking_control:
        bits.ue(1)
    if head.cabac:
        bits.align(1)
        bits.copy(cabac.gray_slice(head.width_mbs, head.height_mbs))
    else:
        bits.copy(_GRAY_MACROBLOCK * head.macroblocks)
        bits.u(1, 1)
    bits.align(0)
    return join_sample([parameters.sps, parameters.pps, escape_payload(bytes([_IDR]), bits.to_bytes())])
