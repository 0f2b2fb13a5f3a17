"""Finds lost pictures of an H.265 stream without decoding it, by the references in its slice headers."""

from __future__ import annotations

from server.media.h265.nal import is_idr, is_picture
from server.media.h265.parameter_sets import parameter_sets
from server.media.h265.slice_header import read_picture_order
from server.media.h265.stream_syntax import StreamSyntax
from server.media.nal_units import join_units, nal_units
from server.media.parameter_sets import UnsupportedParametersError


class ReferenceContinuity:
    """Checks that each picture's reference pictures have arrived (ITU-T H.265, 8.3.2).

    A picture of another size than the first one follows none. Streams whose parameter sets cannot be parsed
    count as continuous.
    """

    def __init__(self) -> None:
        self._syntax: StreamSyntax | None = None
        self._size: tuple[int, int] | None = None
        self._arrived: set[int] = set()
        """Order counts of the pictures of the present GOP that a decoder keeps."""

    def follows(self, access_unit: bytes) -> bool:
        """Return whether an access unit, Annex B, has its beginning and follows the last one."""
        units = nal_units(access_unit)
        slices = [unit for unit in units if is_picture(unit)]
        if not slices:
            return False
        sets = parameter_sets(units)
        if sets is not None:
            try:
                self._syntax = sets.syntax
            except UnsupportedParametersError:
                self._syntax = None
        if self._syntax is None:
            return True
        size = self._syntax.sequence.width, self._syntax.sequence.height
        self._size = self._size or size
        if size != self._size:
            return False
        try:
            order = read_picture_order(join_units(slices[:1]), self._syntax)
        except ValueError:
            return False
        if is_idr(slices[0]):
            self._arrived = {0}
            return True
        counts = 1 << self._syntax.sequence.order_bits
        kept = {reference: (order.count + reference.distance) % counts for reference in order.references}
        # Pictures that are only kept may be missing (H.265, 8.3.2); those that are used may not.
        used = {count for reference, count in kept.items() if reference.used}
        is_whole = used <= self._arrived  # also if it refers to a later picture, which has not arrived
        self._arrived = (self._arrived & set(kept.values())) | {order.count}
        return is_whole
