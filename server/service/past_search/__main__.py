"""The search process: reads a task on standard input, writes the result to standard output."""

from __future__ import annotations

import sys

import msgspec

from server.service.past_search.search import search
from server.service.past_search.worker import SearchTask
from server.system.child_process import terminate_with_parent


def main() -> None:
    """Run one search for the process that started this one."""
    terminate_with_parent()
    task = msgspec.msgpack.decode(sys.stdin.buffer.read(), type=SearchTask)
    sys.stdout.buffer.write(msgspec.msgpack.encode(search(task)))


if __name__ == "__main__":
    main()
