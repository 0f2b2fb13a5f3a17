"""Finds lost pictures of a stream without decoding it, by the numbers in its slice headers."""

from __future__ import annotations

from server.media.bitstream import BitReader, unescape_payload
from server.media.h264.annexb import NAL_IDR, NAL_SLICE, nal_type, parameter_sets
from server.media.h264.repeat_picture import SliceHeaderFormat, parse_slice_header_format
from server.media.nal_units import nal_units
from server.media.parameter_sets import UnsupportedParametersError

_HEADER_BYTES = 32
"""Bytes of a slice that hold the beginning of its header."""


class PictureContinuity:
    """Checks that each picture's reference pictures have arrived, by frame_num (ITU-T H.264, 7.4.3).

    A picture of another size than the first one follows none. Streams whose parameter sets cannot be parsed,
    or allow gaps, count as continuous.
    """

    def __init__(self) -> None:
        self._format: SliceHeaderFormat | None = None
        self._reference = 0
        """frame_num of the last reference picture."""
        self._size: tuple[int, int] | None = None
        """In macroblocks, of the first picture."""

    def follows(self, access_unit: bytes) -> bool:
        """Return whether an access unit, Annex B, has its beginning and follows the last one."""
        units = nal_units(access_unit)
        slices = [unit for unit in units if nal_type(unit) in (NAL_SLICE, NAL_IDR)]
        if not slices:
            return False
        sets = parameter_sets(units)
        if sets is not None:
            try:
                self._format = parse_slice_header_format(sets)
            except UnsupportedParametersError:
                self._format = None
        if self._format is None:
            return True
        size = self._format.width_mbs, self._format.height_mbs
        self._size = self._size or size
        if size != self._size:
            return False
        try:
            head = BitReader(unescape_payload(slices[0][:_HEADER_BYTES]))
            first_macroblock, _, _ = head.ue(), head.ue(), head.ue()
            number = head.u(self._format.frame_num_bits)
        except ValueError:
            return False
        is_key = nal_type(slices[0]) == NAL_IDR
        expected = 0 if is_key else self._format.next_num(self._reference)
        if slices[0][0] & 0x60:  # nal_ref_idc
            self._reference = number
        return first_macroblock == 0 and (number == expected or self._format.may_skip_numbers)
