"""A simulated full disk, by the system's limit of file sizes."""

from __future__ import annotations

import contextlib
import os
import resource
import sys
from collections.abc import Iterator


@contextlib.contextmanager
def files_of_at_most(size: int) -> Iterator[None]:
    """Limit the size of written files, bytes: writing fails halfway, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    dont_write_bytecode = sys.dont_write_bytecode
    # Python 3.11 keeps a truncated .pyc, and fails at each later import of it.
    sys.dont_write_bytecode, os.environ["PYTHONDONTWRITEBYTECODE"] = True, "1"
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        sys.dont_write_bytecode = dont_write_bytecode
        del os.environ["PYTHONDONTWRITEBYTECODE"]
