"""How many asyncio tasks and Python objects a process holds, noted by the process itself.

`hook/sitecustomize.py` calls :func:`note_tasks` as a process of the site starts. Its event loop then
writes two numbers into a file now and then; nothing else is changed.
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
    """What a process holds.

    Attributes:
        tasks: of its event loop.
        blocks: Python's own memory blocks in use, after what is in circles was let go of.
    """

    tasks: int
    blocks: int


def hooked_environment(folder: Path) -> dict[str, str]:
    """Return what the environment of `myview up` needs so that its processes note into a folder."""
    path = [str(_HOOK), str(ROOT), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    return {"PYTHONPATH": os.pathsep.join(filter(None, path)), FOLDER_VARIABLE: str(folder)}


def read_held(folder: Path) -> Mapping[int, ObjectCounts]:
    """Read what the processes have noted last, by their numbers."""
    return {
        int(file.stem): ObjectCounts(**json.loads(file.read_text(encoding="ascii")))
        for file in folder.glob("*.json")
    }


def note_tasks(folder: str) -> None:
    """Let every event loop of this process note what it holds, from when it begins to run."""
    path = Path(folder) / f"{os.getpid()}.json"
    run_forever = asyncio.BaseEventLoop.run_forever

    def note(loop: asyncio.BaseEventLoop) -> None:
        gc.collect()
        part = path.with_suffix(".part")
        held = {"tasks": len(asyncio.all_tasks(loop)), "blocks": sys.getallocatedblocks()}
        part.write_text(json.dumps(held), encoding="ascii")
        part.replace(path)
        loop.call_later(_EVERY_S, note, loop)

    def run(self: asyncio.BaseEventLoop, *args: Any) -> None:
        self.call_later(_EVERY_S, note, self)
        run_forever(self, *args)

    asyncio.BaseEventLoop.run_forever = run  # type: ignore[method-assign]
