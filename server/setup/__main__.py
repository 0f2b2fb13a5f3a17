"""The process that speaks to one camera: a request on standard input, the answer on standard output."""

from __future__ import annotations

import logging
import os
import resource
import sys

import msgspec

from server.setup.trial_messages import ProfilesRequest, StreamRequest
from server.system.log_format import formatter

log = logging.getLogger(__name__)

_MEMORY_BYTES = 2 << 30
"""Most memory of this process: a camera may send an endless answer."""


def main() -> None:
    """Answer one request."""
    handler = logging.StreamHandler()
    handler.setFormatter(formatter("setup"))
    logging.basicConfig(handlers=[handler], level=logging.WARNING)
    resource.setrlimit(resource.RLIMIT_DATA, (_MEMORY_BYTES, _MEMORY_BYTES))
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # libraries that print must not damage the answer
    try:
        request = msgspec.msgpack.decode(sys.stdin.buffer.read(), type=StreamRequest | ProfilesRequest)
        answers.write(msgspec.msgpack.encode(_answer(request)))
        answers.close()
    except Exception:  # its text may contain an address, which the log's format hides
        log.exception("a camera could not be tried")
    finally:
        os._exit(0)  # threads of libraries may still wait for the camera


def _answer(request: StreamRequest | ProfilesRequest) -> msgspec.Struct:
    """Answer; a request loads only the libraries that it needs."""
    if isinstance(request, StreamRequest):
        from server.setup.stream_trial import run_trial  # noqa: PLC0415

        return run_trial(request)
    from server.setup.onvif_profiles import query_profiles  # noqa: PLC0415

    logging.getLogger().setLevel(logging.CRITICAL)  # the library logs addresses
    return query_profiles(request)


if __name__ == "__main__":
    main()
