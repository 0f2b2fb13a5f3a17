"""The numbers of asyncio tasks and memory blocks of a process, written by the process itself.

`hook/sitecustomize.py` calls :func:`note_tasks` as a process of the site starts. Its event loop then
writes both numbers into a file periodically; nothing else is changed.
"""

from __future__ import annotations

import asyncio
import gc
import json
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.common.environment import ROOT

FOLDER_VARIABLE = "BENCH_TASKS_FOLDER"
_HOOK = Path(__file__).parent / "hook"
_EVERY_S = 2.0


@dataclass(frozen=True, slots=True)
class ObjectCounts:
    """Counts of a process.

    Attributes:
        tasks: of its event loop.
        blocks: memory blocks of Python's allocator in use after a garbage collection.
    """

    tasks: int
    blocks: int


def hooked_environment(folder: Path) -> dict[str, str]:
    """Return the environment variables that make the processes of `myview up` write counts into a folder."""
    path = [str(_HOOK), str(ROOT), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    return {"PYTHONPATH": os.pathsep.join(filter(None, path)), FOLDER_VARIABLE: str(folder)}


def read_object_counts(folder: Path) -> Mapping[int, ObjectCounts]:
    """Read the last counts of each process, by process id."""
    return {
        int(file.stem): ObjectCounts(**json.loads(file.read_text(encoding="ascii")))
        for file in folder.glob("*.json")
    }


def note_tasks(folder: str) -> None:
    """Let every event loop of this process write its counts periodically."""
    path = Path(folder) / f"{os.getpid()}.json"
    run_forever = asyncio.BaseEventLoop.run_forever

    def note(loop: asyncio.BaseEventLoop) -> None:
        gc.collect()
        part = path.with_suffix(".part")
        counts = {"tasks": len(asyncio.all_tasks(loop)), "blocks": sys.getallocatedblocks()}
        part.write_text(json.dumps(counts), encoding="ascii")
        part.replace(path)
        loop.call_later(_EVERY_S, note, loop)

    def run(self: asyncio.BaseEventLoop, *args: Any) -> None:
        self.call_later(_EVERY_S, note, self)
        run_forever(self, *args)

    asyncio.BaseEventLoop.run_forever = run  # type: ignore[method-assign]
