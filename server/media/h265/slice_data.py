"""Slice data of skipped blocks, or of gray ones (ITU-T H.265, 7.3.8 and 9.3).

Each coding tree block is one coding block, except at the right and lower edge, where it must be split.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from functools import lru_cache

from server.media.arithmetic_coder import ArithmeticEncoder, ContextModel
from server.media.bitstream import BitWriter
from server.media.h265.stream_syntax import StreamSyntax

SLICE_QP = 51
"""The quantizer at which the initial contexts make skipping most probable."""
# initValue, by syntax element (tables 9-7 to 9-31): of I slices, and of P slices with cabac_init_flag 0.
_Contexts = dict[str, tuple[int, ...]]
_GRAY: _Contexts = {
    "split": (139, 141, 157),
    "lossless": (154,),
    "part_mode": (184,),
    "previous_mode": (184,),
    "chroma_mode": (63,),
    "split_transform": (153, 138, 138),
    "cbf_luma": (111, 141),
    "cbf_chroma": (94,),
}
_SKIPPED: _Contexts = {"split": (107, 139, 126), "lossless": (154,), "skip": (197, 185, 201)}
_LARGEST_SPLIT_FLAG = 5
"""Binary logarithm of the largest transform block."""


@lru_cache(maxsize=4)
def skipped_blocks(syntax: StreamSyntax) -> tuple[bytes, ...]:
    """Return the substreams of a picture that equals its reference: the last with rbsp_stop_one_bit.

    They are the same in every picture of a format, and cached: coding takes milliseconds.
    """
    return tuple(_SkippedPicture(syntax).substreams())


@lru_cache(maxsize=4)
def gray_blocks(syntax: StreamSyntax) -> tuple[bytes, ...]:
    """Return the substreams of an intra picture without residual: mid-gray (8.4.4.2.2)."""
    return tuple(_GrayPicture(syntax).substreams())


class _Picture(ABC):
    """Encodes the coding trees of a picture that is one slice."""

    values: _Contexts

    def __init__(self, syntax: StreamSyntax) -> None:
        self.syntax = syntax
        self._size, self.blocks = (syntax.sequence.width, syntax.sequence.height), syntax.sequence.blocks
        self._columns, self._rows = (-(-side // (1 << self.blocks.ctb)) for side in self._size)
        # The depth of the blocks on the left and above, by row and column of smallest blocks.
        smallest = self.blocks.ctb - self.blocks.min_cb
        self._left, self._above = [0] * (self._rows << smallest), [0] * (self._columns << smallest)
        self._contexts = self._initial_contexts()
        self.coder = ArithmeticEncoder(BitWriter())

    def substreams(self) -> Iterator[bytes]:
        """Yield the picture's substreams: one, or one for each row of blocks."""
        ctb, wavefront = self.blocks.ctb, self.syntax.picture.wavefront
        bits, above = BitWriter(), self._contexts
        self.coder = ArithmeticEncoder(bits)
        for row in range(self._rows):
            if wavefront:  # it begins with the contexts behind the second block of the row above (9.3.1)
                self._contexts = above if row and self._columns > 1 else self._initial_contexts()
            for column in range(self._columns):
                self._tree(column << ctb, row << ctb, ctb, 0)
                is_last = column == self._columns - 1 and row == self._rows - 1
                if wavefront and column == 1:
                    above = {
                        name: [context.copy() for context in models]
                        for name, models in self._contexts.items()
                    }
                self.coder.terminate(end=is_last)
            if wavefront and row < self._rows - 1:
                self.coder.terminate(end=True)  # end_of_subset_one_bit
                bits.align(0)
                yield bits.to_bytes()
                bits = BitWriter()
                self.coder = ArithmeticEncoder(bits)
        bits.align(0)
        yield bits.to_bytes()

    @abstractmethod
    def block(self, left: int, top: int, size: int) -> None:
        """Encode a coding block; ``size`` is a binary logarithm."""

    def put(self, bit: int, name: str, increment: int = 0) -> None:
        """Encode a bit of a syntax element; ``increment`` is ctxInc."""
        self.coder.put(bit, self._contexts[name][increment])

    def _initial_contexts(self) -> dict[str, list[ContextModel]]:
        return {name: [_context(value) for value in values] for name, values in self.values.items()}

    def _tree(self, left: int, top: int, size: int, depth: int) -> None:
        (width, height), smallest = self._size, self.blocks.min_cb
        side = 1 << size
        fits = left + side <= width and top + side <= height
        can_split = size > smallest
        column, row = left >> smallest, top >> smallest
        if fits and can_split:
            deeper = (left > 0 and self._left[row] > depth) + (top > 0 and self._above[column] > depth)
            self.put(0, "split", deeper)
        if not fits and can_split:
            half = side >> 1
            for y in (top, top + half):
                for x in (left, left + half):
                    if x < width and y < height:
                        self._tree(x, y, size - 1, depth + 1)
            return
        if self.syntax.picture.lossless_blocks:
            self.put(0, "lossless")
        self.block(left, top, size)
        count = max(1, side >> smallest)
        self._left[row : row + count] = [depth] * count
        self._above[column : column + count] = [depth] * count


class _SkippedPicture(_Picture):
    """Every block is skipped and merged with its neighbor, which does not move, or with zero motion."""

    values = _SKIPPED

    def block(self, left: int, top: int, size: int) -> None:
        """Encode cu_skip_flag; there is no merge_idx, as the slice has one candidate."""
        del size
        self.put(1, "skip", (left > 0) + (top > 0))


class _GrayPicture(_Picture):
    """Every block is predicted from its neighbors, by their mean or planar, and has no residual."""

    values = _GRAY

    def block(self, left: int, top: int, size: int) -> None:
        """Encode a block whose prediction mode is that of its neighbor on the left."""
        del left, top
        pcm = self.syntax.sequence.pcm
        if size == self.blocks.min_cb:
            self.put(1, "part_mode")
        if pcm is not None and pcm[0] <= size <= pcm[1]:
            self.coder.terminate(end=False)
        self.put(1, "previous_mode")
        self.coder.bypass(0)  # the first of the most probable modes: never an angular one
        self.put(0, "chroma_mode")
        self._transform(size, 0)

    def _transform(self, size: int, depth: int) -> None:
        is_split = size > self.blocks.max_tb
        if not is_split and size > self.blocks.min_tb and depth < self.blocks.intra_depth:
            self.put(0, "split_transform", _LARGEST_SPLIT_FLAG - size)
        if depth == 0:
            self.put(0, "cbf_chroma")
            self.put(0, "cbf_chroma")
        if is_split:
            for _ in range(4):
                self._transform(size - 1, depth + 1)
        else:
            self.put(0, "cbf_luma", int(depth == 0))


def _context(value: int) -> ContextModel:
    """Return the context of an initValue, at :data:`SLICE_QP` (9.3.2.2)."""
    slope, offset = 5 * (value >> 4) - 45, 8 * (value & 15) - 16
    return ContextModel((slope * SLICE_QP >> 4) + offset)
