"""The worker's side: answers requests on standard input until that ends."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable
from typing import BinaryIO, TypeVar

import msgspec

from server.system.log_format import formatter
from server.system.worker.protocol import LENGTH_BYTES, READY, encode_message

Settings = TypeVar("Settings", bound=msgspec.Struct)
Request = TypeVar("Request", bound=msgspec.Struct)


def answer_requests(
    requests: BinaryIO,
    answers: BinaryIO,
    settings_type: type[Settings],
    request_type: type[Request],
    make: Callable[[Settings], Callable[[Request], msgspec.Struct]],
) -> None:
    """Answer requests until the parent closes the pipe, or ends.

    ``make`` gets the settings and returns the function that answers.
    """
    first = _message(requests)
    if first is None:
        return
    answer = make(msgspec.msgpack.decode(first, type=settings_type))
    decoder = msgspec.msgpack.Decoder(request_type)
    answers.write(READY)
    answers.flush()
    while (body := _message(requests)) is not None:
        answers.write(encode_message(answer(decoder.decode(body))))
        answers.flush()


def run_worker(name: str, serve: Callable[[BinaryIO, BinaryIO], None]) -> None:
    """Run a worker, whose log lines begin with a name, on standard input and output."""
    handler = logging.StreamHandler()
    handler.setFormatter(formatter(name))
    logging.basicConfig(handlers=[handler], level=logging.WARNING)
    try:
        serve(sys.stdin.buffer, sys.stdout.buffer)
    except BrokenPipeError:  # the parent ended first
        os._exit(0)  # standard output cannot be flushed any more


def _message(requests: BinaryIO) -> bytes | None:
    head = requests.read(LENGTH_BYTES)
    if len(head) < LENGTH_BYTES:
        return None
    size = int.from_bytes(head, "big")
    body = requests.read(size)
    return body if len(body) == size else None
