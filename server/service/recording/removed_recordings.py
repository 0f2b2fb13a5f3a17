"""Finding out that what was recorded is not on the disk any more, before somebody is promised it."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from server.service.recording.playback import Recorded, Source
from server.service.recording.segment_index import Stretch


def forget_gone(source: Source, start: int, end: int | None = None) -> None:
    """See that the first and the last of what is recorded of ``start … end - 1`` are there, or forget them.

    So what is played begins with something. Whatever is missing in between is a hole like others.

    Raises:
        OSError: nobody can tell: it may not be read, or the disk fails.
    """
    for one in source.recorded:
        ends = one.tape.at_or_after(start), one.tape.before(sys.maxsize if end is None else end)
        _check(one, {it for it in ends if it is not None})


def forget_all_gone(source: Source, start: int, end: int) -> None:
    """See that all of what is recorded of ``start … end - 1`` is there, or forget what is not.

    Raises:
        OSError: nobody can tell.
    """
    for one in source.recorded:
        _check(one, {(it.camera, it.file): it for it in one.tape.between(start, end)}.values())


def _check(one: Recorded, stretches: Iterable[Stretch]) -> None:
    if not all(map(one.run.holds, stretches)):
        one.run.forget_missing()
