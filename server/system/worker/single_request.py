"""A worker process for one request: started, asked once, and gone."""

from __future__ import annotations

import asyncio
import contextlib
from typing import TypeVar

import msgspec

from server.system.child_process import start_worker
from server.system.worker.process import WorkerDiedError

Answer = TypeVar("Answer", bound=msgspec.Struct)


async def ask_new_worker(
    module: str, request: msgspec.Struct, answer_type: type[Answer], within_s: float | None = None
) -> Answer:
    """Start a module, send it a request as MessagePack, and return its answer.

    The process is killed if the caller is cancelled, or it takes longer than ``within_s``; None: no limit.

    Raises:
        OSError: the process cannot be started.
        TimeoutError: it took too long.
        WorkerDiedError: it ended without a valid answer.
    """
    process = await start_worker(module)
    try:
        async with asyncio.timeout(within_s):
            output, _ = await process.communicate(msgspec.msgpack.encode(request))
        return msgspec.msgpack.decode(output, type=answer_type)
    except msgspec.DecodeError as error:
        raise WorkerDiedError(f"ended with status {process.returncode}") from error
    finally:
        if process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
