"""Writes an H.264 picture that repeats the previous one, to fill a gap in a stream.

It is a P picture in which every macroblock is skipped (ITU-T H.264, 7.3.4): about ten bytes, and pixel by
pixel equal to the previous picture. The parameter sets determine the format of its slice header.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from server.media.bitstream import BitReader, BitWriter, escape_payload, unescape_payload
from server.media.h264 import cabac
from server.media.h264.annexb import NAL_IDR, NAL_SLICE, H264ParameterSets, nal_type
from server.media.parameter_sets import UnsupportedParametersError

_HIGH_PROFILES = frozenset({44, 83, 86, 100, 110, 118, 122, 128, 134, 135, 138, 139, 244})
"""Profiles whose sequence parameter set has chroma_format_idc and more (7.3.2.1.1)."""
_LENGTH_BYTES = 4
_SLICE_P = 5
"""slice_type of a picture all of whose slices are P."""
_REFERENCE = 0x40 | NAL_SLICE
"""NAL header with nal_ref_idc 2."""
_ORDER_BY_NUMBERS, _ORDER_BY_DECODING = 0, 2
"""pic_order_cnt_type: explicit in each picture, or the decoding order (no B pictures)."""
_MAX_MACROBLOCKS = 139_264
"""Macroblocks of a picture at the highest level (table A-1): bounds the time to write one."""
_MAX_FRAME_NUM_BITS = 16
"""Also the limit of pic_order_cnt_lsb."""


@dataclass(frozen=True, slots=True)
class SliceHeaderFormat:
    """The fields of slice headers, according to the parameter sets.

    Attributes:
        width_mbs, height_mbs: of a picture, in macroblocks.
        order_bits: bits of pic_order_cnt_lsb; 0: the output order is the decoding order.
        order_of_fields: bottom_field_pic_order_in_frame_present_flag.
        may_skip_numbers: gaps_in_frame_num_value_allowed_flag.
    """

    pps_id: int
    frame_num_bits: int
    width_mbs: int
    height_mbs: int
    order_bits: int
    order_of_fields: bool
    cabac: bool
    weighted: bool
    init_qp: int
    deblocking_control: bool
    redundant: bool
    may_skip_numbers: bool = False

    @property
    def macroblocks(self) -> int:
        """The number of macroblocks of a picture."""
        return self.width_mbs * self.height_mbs

    def frame_num(self, sample: bytes) -> int:
        """Return frame_num of a sample, length-prefixed NAL units.

        Raises:
            ValueError: it contains no picture.
        """
        at = 0
        while at + _LENGTH_BYTES < len(sample):
            length = int.from_bytes(sample[at : at + _LENGTH_BYTES], "big")
            at += _LENGTH_BYTES
            if nal_type(sample[at : at + 1]) in (NAL_SLICE, NAL_IDR):
                head = BitReader(unescape_payload(sample[at : at + min(length, 32)]))
                head.ue(), head.ue(), head.ue()
                return head.u(self.frame_num_bits)
            at += length
        raise ValueError("the sample contains no picture")

    def next_num(self, frame_num: int) -> int:
        """Return the frame_num after this one."""
        return (frame_num + 1) % (1 << self.frame_num_bits)

    def repeat(self, frame_num: int, *, reference: bool) -> bytes:
        """Return a sample that shows the previous picture again, with this ``frame_num``.

        A non-reference picture has the number of the picture after it: one, but not two in a row, can be
        inserted between two pictures of a camera (8.2.1.3).
        """
        bits = BitWriter()
        for value in (0, _SLICE_P, self.pps_id):
            bits.ue(value)
        bits.u(self.frame_num_bits, frame_num)
        if self.redundant:
            bits.ue(0)
        bits.u(1, 1)  # num_ref_idx_active_override_flag: one reference, the newest picture
        bits.ue(0)
        bits.u(1, 0)
        if self.weighted:
            for value in (0, 0):
                bits.ue(value)
            bits.u(2, 0)  # no weights
        if reference:
            bits.u(1, 0)
        if self.cabac:
            bits.ue(0)
        bits.se(cabac.SLICE_QP - self.init_qp)
        if self.deblocking_control:
            bits.ue(1)
        if self.cabac:
            bits.align(1)
            bits.copy(cabac.skipped_slice(self.macroblocks))
        else:
            bits.ue(self.macroblocks)  # mb_skip_run
            bits.u(1, 1)
        bits.align(0)
        unit = escape_payload(bytes([_REFERENCE if reference else NAL_SLICE]), bits.to_bytes())
        return len(unit).to_bytes(_LENGTH_BYTES, "big") + unit


def parse_repeatable(parameters: H264ParameterSets) -> SliceHeaderFormat:
    """Parse the slice header format of streams whose last picture can be repeated.

    Raises:
        UnsupportedParametersError: they are damaged, or use features that x264 does not use without B
            pictures.
    """
    header_format = parse_slice_header_format(parameters)
    if header_format.order_bits:
        raise UnsupportedParametersError("the output order may differ from the decoding order")
    return header_format


@lru_cache(maxsize=8)
def parse_slice_header_format(parameters: H264ParameterSets) -> SliceHeaderFormat:
    """Parse the format of slice headers from the parameter sets.

    Raises:
        UnsupportedParametersError: they are damaged, or use rare features.
    """
    try:
        sps = _read_sps(BitReader(unescape_payload(parameters.sps)))
        return _read_pps(BitReader(unescape_payload(parameters.pps)), sps)
    except ValueError as error:
        raise UnsupportedParametersError(str(error)) from error


@dataclass(frozen=True, slots=True)
class _SequenceParameters:
    """Fields of the sequence parameter set, as in :class:`SliceHeaderFormat`."""

    frame_num_bits: int
    width_mbs: int
    height_mbs: int
    order_bits: int
    may_skip_numbers: bool


def _read_sps(bits: BitReader) -> _SequenceParameters:
    profile = bits.u(8)
    bits.u(16)
    bits.ue()
    if profile in _HIGH_PROFILES:
        chroma_format, depth, chroma_depth = bits.ue(), bits.ue(), bits.ue()
        if (chroma_format, depth, chroma_depth) != (1, 0, 0):
            raise ValueError("not 8 bit 4:2:0")
        bits.u(1)
        if bits.u(1):
            raise ValueError("scaling lists")
    frame_num_bits = bits.ue() + 4
    order = bits.ue()
    if order not in (_ORDER_BY_NUMBERS, _ORDER_BY_DECODING):
        raise ValueError("pic_order_cnt_type 1")
    order_bits = bits.ue() + 4 if order == _ORDER_BY_NUMBERS else 0
    bits.ue()
    may_skip_numbers = bool(bits.u(1))
    width_mbs, height_mbs = bits.ue() + 1, bits.ue() + 1
    if not bits.u(1):
        raise ValueError("interlaced")
    if width_mbs * height_mbs > _MAX_MACROBLOCKS or max(frame_num_bits, order_bits) > _MAX_FRAME_NUM_BITS:
        raise ValueError("beyond the highest level")
    return _SequenceParameters(frame_num_bits, width_mbs, height_mbs, order_bits, may_skip_numbers)


def _read_pps(bits: BitReader, sps: _SequenceParameters) -> SliceHeaderFormat:
    pps_id = bits.ue()
    bits.ue()
    arithmetic = bool(bits.u(1))
    order_of_fields = bool(bits.u(1))
    if bits.ue():
        raise ValueError("slice groups")
    bits.ue()
    bits.ue()
    weighted = bool(bits.u(1))
    bits.u(2)
    init_qp = 26 + bits.se()
    bits.se()
    bits.se()
    deblocking_control = bool(bits.u(1))
    bits.u(1)
    redundant = bool(bits.u(1))
    return SliceHeaderFormat(
        pps_id=pps_id,
        frame_num_bits=sps.frame_num_bits,
        width_mbs=sps.width_mbs,
        height_mbs=sps.height_mbs,
        order_bits=sps.order_bits,
        order_of_fields=order_of_fields,
        cabac=arithmetic,
        weighted=weighted,
        init_qp=init_qp,
        deblocking_control=deblocking_control,
        redundant=redundant,
        may_skip_numbers=sps.may_skip_numbers,
    )
