"""Writes H.265 pictures that repeat the previous one, to fill a gap in a stream.

They are P pictures in which every block is skipped (ITU-T H.265, 7.3.8.5): some ten bytes, and pixel by
pixel equal to the previous picture. Each picture lists the pictures that a decoder keeps, so a repetition
lists what the picture after it needs. Its picture order count is its own, between those of its neighbors.
"""

from __future__ import annotations

from server.media.h265.nal import NAL_TRAIL_N, NAL_TRAIL_R
from server.media.h265.parameter_sets import H265ParameterSets
from server.media.h265.reference_sets import Reference, ReferenceSet
from server.media.h265.slice_data import skipped_blocks
from server.media.h265.slice_header import PictureOrder, write_repeat
from server.media.h265.stream_syntax import StreamSyntax
from server.media.nal_units import join_units
from server.media.parameter_sets import UnsupportedParametersError


def parse_repeatable_syntax(parameters: H265ParameterSets) -> StreamSyntax:
    """Parse the syntax of streams whose last picture can be repeated.

    Raises:
        UnsupportedParametersError: they are damaged, or use features that are not supported here.
    """
    syntax = parameters.syntax
    if not syntax.sequence.kept:
        raise UnsupportedParametersError("a decoder keeps no picture to repeat")
    return syntax


def repeat_after(syntax: StreamSyntax, count: int) -> bytes:
    """Return a sample that repeats the picture of order count ``count``; it has the next one.

    Only a keyframe, or another repetition, can follow.
    """
    return join_units([
        write_repeat(
            syntax, NAL_TRAIL_R, count + 1, (Reference(-1, used=True),), skipped_blocks(syntax)
        )
    ])  # fmt: skip


def repeat_between(syntax: StreamSyntax, newest: PictureOrder, picture: PictureOrder) -> bytes:
    """Return a sample that repeats ``newest``, and after which ``picture`` can still be decoded.

    It must be possible (:func:`can_insert`).
    """
    references = _references_between(syntax, newest, picture)
    return join_units([
        write_repeat(syntax, NAL_TRAIL_N, newest.count + 1, references, skipped_blocks(syntax))
    ])  # fmt: skip


def can_insert(syntax: StreamSyntax, newest: PictureOrder, picture: PictureOrder) -> bool:
    """Return whether a repetition of ``newest`` can be inserted before ``picture``.

    It cannot if ``picture`` refers to one that is missing between them, if its order count follows at once,
    or if a decoder does not keep as many pictures.
    """
    steps = _steps(syntax, newest, picture)
    has_lost = any(reference.distance > -steps for reference in picture.references)
    if has_lost or picture.long_term or steps < 2:  # noqa: PLR2004 — there is no number between
        return False
    return len(_references_between(syntax, newest, picture)) <= syntax.sequence.kept


def _references_between(syntax: StreamSyntax, newest: PictureOrder, picture: PictureOrder) -> ReferenceSet:
    """Return ``newest``, which is used, and what ``picture`` keeps, seen from the order count after it."""
    forward = _steps(syntax, newest, picture) - 1
    distances = {-1} | {reference.distance + forward for reference in picture.references}
    return tuple(Reference(distance, used=distance == -1) for distance in sorted(distances, reverse=True))


def _steps(syntax: StreamSyntax, newest: PictureOrder, picture: PictureOrder) -> int:
    """Return by how much the order count grows from ``newest`` to ``picture``."""
    return (picture.count - newest.count) % (1 << syntax.sequence.order_bits)
