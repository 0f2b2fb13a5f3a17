"""The parent side of a render worker process: starts it, sends requests, ends it."""

from __future__ import annotations

import asyncio
import contextlib
from typing import NoReturn, Self

import msgspec

from server.media.rendering_messages import LENGTH_BYTES, Canvas, RenderRequest, RenderResult, encode_message
from server.system.child_process import start_worker

_ANSWER_S = 5.0
"""An answer that takes longer does not come: the process hangs."""
_PART_BYTES = 1 << 16


class WorkerDiedError(Exception):
    """The drawing process has ended, or hangs and was killed."""


class RenderWorker:
    """A running process. Whoever started it calls :meth:`end`."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        assert process.stdin is not None  # noqa: S101 — tells mypy that there are pipes
        assert process.stdout is not None  # noqa: S101
        self._process, self._requests, self._answers = process, process.stdin, process.stdout
        self._turn = asyncio.Lock()
        self._decoder = msgspec.msgpack.Decoder(RenderResult)

    @classmethod
    async def start(cls, canvas: Canvas) -> Self:
        """Start one.

        Raises:
            ProcessDiedError: the system does not let it start.
        """
        try:
            process = await start_worker("server.service.rendering.worker")
        except OSError as error:
            raise WorkerDiedError(f"cannot be started: {error.strerror}") from error
        started = cls(process)
        started._requests.write(encode_message(canvas))
        return started

    @property
    def pid(self) -> int:
        """Its number in the system."""
        return self._process.pid

    async def ask(self, request: RenderRequest) -> RenderResult:
        """Send a request and return the answer; requests are answered one at a time.

        Whoever gives up waiting must end the process: the answer would be taken for another's.

        Raises:
            ProcessDiedError: there is none, and the process is of no use any more.
        """
        async with self._turn:
            try:
                async with asyncio.timeout(_ANSWER_S):
                    self._requests.write(encode_message(request))
                    await self._requests.drain()
                    size = int.from_bytes(await self._answers.readexactly(LENGTH_BYTES), "big")
                    return self._decoder.decode(await self._answers.readexactly(size))
            except TimeoutError as error:
                raise WorkerDiedError(f"gave no answer within {_ANSWER_S:g} s") from error
            except (OSError, asyncio.IncompleteReadError) as error:
                raise WorkerDiedError("died") from error
            except msgspec.DecodeError as error:
                raise WorkerDiedError(f"gave no sense: {error}") from error

    async def watch(self) -> NoReturn:
        """Wait until it dies by itself, which may be long before it is asked again.

        Raises:
            ProcessDiedError: it has died.
        """
        await self._process.wait()
        raise WorkerDiedError("died")

    async def end(self) -> None:
        """End it: it has nothing to save. Nobody asks it any more."""
        with contextlib.suppress(ProcessLookupError):
            self._process.kill()
        self._requests.close()
        # Until somebody has read what is left of a long answer its pipe stays open, and is waited for.
        while await self._answers.read(_PART_BYTES):
            pass
        await self._process.wait()
