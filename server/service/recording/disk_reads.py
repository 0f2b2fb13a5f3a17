"""Reading what is recorded, in threads of its own: a disk that hangs keeps nothing waiting but the past."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import ParamSpec, TypeVar

Given = ParamSpec("Given")
Read = TypeVar("Read")

_AT_ONCE = 8
_THREADS = ThreadPoolExecutor(_AT_ONCE, "past")


async def from_disk(read: Callable[Given, Read], *args: Given.args, **kwargs: Given.kwargs) -> Read:
    """Read something in one of these threads."""
    return await asyncio.get_running_loop().run_in_executor(_THREADS, partial(read, *args, **kwargs))
