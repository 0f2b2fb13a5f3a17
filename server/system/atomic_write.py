"""Atomic output: a file or folder appears only when it is complete."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from server.system.errors import UserError, reason_of

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS}
"""Errors of a full disk."""


def check_output_folder(out: Path) -> None:
    """Check that a folder does not exist or is empty.

    Raises:
        UserError: it is not.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise UserError(f"{out}: exists and is not an empty folder; name another, or remove it")


def check_output_file(out: Path, *inputs: Path | None) -> None:
    """Check that a file can be written; ``inputs`` are input files, which it must not replace.

    Raises:
        UserError: it is a folder, a device, or one of the inputs.
    """
    if out.is_dir():
        raise UserError(f"{out}: is a folder; name a file")
    if not out.exists():
        return
    if not out.is_file():
        raise UserError(f"{out}: is not a regular file, and would be replaced by one; name another")
    if any(path is not None and path.exists() and out.samefile(path) for path in inputs):
        raise UserError(f"{out}: is an input, and would be replaced; name another")


@contextmanager
def atomic_folder(out: Path) -> Iterator[Path]:
    """Yield a folder to write into; it becomes ``out`` only if the block succeeds.

    Raises:
        UserError: ``out`` exists and is not an empty folder, or cannot be created.
    """
    check_output_folder(out)
    target = out.resolve()
    with _cannot_write(out):
        target.parent.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    try:
        with _cannot_write(out, _FULL):
            yield draft
        with _cannot_write(out):
            draft.chmod(0o777 & ~_umask())  # mkdtemp creates it with mode 700
            draft.replace(target)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


@contextmanager
def atomic_file(out: Path, *inputs: Path | None) -> Iterator[Path]:
    """Yield a file to write; it replaces ``out`` only if the block succeeds.

    ``inputs`` are input files, which it must not replace.

    Raises:
        UserError: ``out`` cannot be written; checked before the block runs.
    """
    check_output_file(out, *inputs)
    target = out.resolve()
    with _cannot_write(out):
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{target.name}-", dir=target.parent)
        os.close(handle)
    draft = Path(name)
    try:
        with _cannot_write(out, _FULL):
            yield draft
        with _cannot_write(out):
            draft.chmod(0o666 & ~_umask())
            draft.replace(target)
    finally:
        draft.unlink(missing_ok=True)


@contextmanager
def _cannot_write(out: Path, only: Collection[int] | None = None) -> Iterator[None]:
    """Turn an OSError into a UserError; ``only``: only these errno."""
    try:
        yield
    except OSError as error:
        if only is not None and error.errno not in only:
            raise
        raise UserError(f"{out}: cannot write there: {reason_of(error)}") from error


def _umask() -> int:
    """Return the process's umask, which can only be read by setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
