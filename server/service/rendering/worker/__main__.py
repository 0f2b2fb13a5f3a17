"""The worker's main loop: requests on standard input, answers on standard output, until the input ends."""

from __future__ import annotations

import logging
import os
import sys
from typing import BinaryIO

# Before NumPy is imported: each stream has a process already, and needs no more threads.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import msgspec

from server.media.rendering_messages import LENGTH_BYTES, READY, RenderRequest, RenderSettings, encode_message
from server.service.rendering.worker.stream_renderer import StreamRenderer
from server.system.log_format import formatter


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer requests until the service closes the pipe, or ends."""
    first = _message(requests)
    if first is None:
        return
    renderer = StreamRenderer(msgspec.msgpack.decode(first, type=RenderSettings))
    decoder = msgspec.msgpack.Decoder(RenderRequest)
    answers.write(READY)
    answers.flush()
    while (body := _message(requests)) is not None:
        answers.write(encode_message(renderer.render(decoder.decode(body))))
        answers.flush()


def _message(requests: BinaryIO) -> bytes | None:
    head = requests.read(LENGTH_BYTES)
    if len(head) < LENGTH_BYTES:
        return None
    size = int.from_bytes(head, "big")
    body = requests.read(size)
    return body if len(body) == size else None


def main() -> None:
    """Run the worker."""
    handler = logging.StreamHandler()
    handler.setFormatter(formatter("draw"))
    logging.basicConfig(handlers=[handler], level=logging.WARNING)
    cv2.setNumThreads(1)
    try:
        serve(sys.stdin.buffer, sys.stdout.buffer)
    except BrokenPipeError:  # the service ended first
        os._exit(0)  # standard output cannot be flushed any more


if __name__ == "__main__":
    main()
