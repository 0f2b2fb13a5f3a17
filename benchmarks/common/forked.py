"""Computations in a copy of the running process."""

from __future__ import annotations

import multiprocessing
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import TypeVar

Result = TypeVar("Result")
_CONTEXT = multiprocessing.get_context("fork")


def in_copy(function: Callable[[], Result]) -> Result:
    """Run a function in a copy of this process, whose own state stays as it is; return what it returns.

    Raises:
        RuntimeError: the function has raised an error, which the copy has printed.
    """
    receiver, sender = _CONTEXT.Pipe(duplex=False)
    process = _CONTEXT.Process(target=_send, args=(function, sender))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # the threads of libraries are idle
        process.start()
    sender.close()
    try:
        result: Result = receiver.recv()
    except EOFError:
        raise RuntimeError("the copy of the process has failed") from None
    finally:
        process.join()
    return result


def _send(function: Callable[[], Result], sender: Connection) -> None:
    sender.send(function())
