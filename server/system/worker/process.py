"""The parent's side of a worker process: starts it, sends requests, ends it."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Generic, NoReturn, Self, TypeVar

import msgspec

from server.system.child_process import start_worker
from server.system.errors import reason_of
from server.system.worker.protocol import LENGTH_BYTES, READY, encode_message

Answer = TypeVar("Answer", bound=msgspec.Struct)

START_S = 30.0
"""How long a worker may take to load its libraries, even on a busy machine."""
_READ_BYTES = 1 << 16


class WorkerDiedError(Exception):
    """The worker has ended, or hangs and was killed."""


class WorkerProcess(Generic[Answer]):
    """A running worker process; the caller of :meth:`start` calls :meth:`kill`.

    A worker that takes longer than ``answer_s`` to answer counts as hung.
    """

    def __init__(
        self, process: asyncio.subprocess.Process, answer_type: type[Answer], answer_s: float
    ) -> None:
        assert process.stdin is not None  # noqa: S101 — tells mypy that there are pipes
        assert process.stdout is not None  # noqa: S101
        self._process, self._requests, self._answers = process, process.stdin, process.stdout
        self._lock = asyncio.Lock()
        self._is_ready = False
        self._decoder = msgspec.msgpack.Decoder(answer_type)
        self._answer_s = answer_s

    @classmethod
    async def start(
        cls, module: str, settings: msgspec.Struct, answer_type: type[Answer], answer_s: float
    ) -> Self:
        """Start a module as a worker with its settings; :meth:`wait_until_ready` waits for it.

        Raises:
            WorkerDiedError: the process cannot be started.
        """
        try:
            process = await start_worker(module)
        except OSError as error:
            raise WorkerDiedError(f"cannot be started: {reason_of(error)}") from error
        started = cls(process, answer_type, answer_s)
        started._requests.write(encode_message(settings))
        return started

    @property
    def pid(self) -> int:
        """The process id."""
        return self._process.pid

    async def wait_until_ready(self) -> None:
        """Wait until the worker has loaded its libraries and answers requests.

        Raises:
            WorkerDiedError: it died, or took longer than :data:`START_S`.
        """
        async with self._lock:
            if self._is_ready:
                return
            try:
                async with asyncio.timeout(START_S):
                    await self._answers.readexactly(len(READY))
            except TimeoutError as error:
                raise WorkerDiedError(f"was not ready within {START_S:g} s") from error
            except (OSError, asyncio.IncompleteReadError) as error:
                raise WorkerDiedError("died") from error
            self._is_ready = True

    async def ask(self, request: msgspec.Struct) -> Answer:
        """Send a request and return the answer; requests are answered one at a time.

        A caller that is cancelled must kill the worker: the next caller would read its answer.

        Raises:
            WorkerDiedError: there is no valid answer; the worker must be replaced.
        """
        await self.wait_until_ready()
        async with self._lock:
            try:
                async with asyncio.timeout(self._answer_s):
                    self._requests.write(encode_message(request))
                    await self._requests.drain()
                    size = int.from_bytes(await self._answers.readexactly(LENGTH_BYTES), "big")
                    return self._decoder.decode(await self._answers.readexactly(size))
            except TimeoutError as error:
                raise WorkerDiedError(f"gave no answer within {self._answer_s:g} s") from error
            except (OSError, asyncio.IncompleteReadError) as error:
                raise WorkerDiedError("died") from error
            except msgspec.DecodeError as error:
                raise WorkerDiedError(f"sent an invalid answer: {error}") from error

    async def wait_until_dead(self) -> NoReturn:
        """Wait until the worker dies by itself, which may be long before its next request.

        Raises:
            WorkerDiedError: always.
        """
        await self._process.wait()
        raise WorkerDiedError("died")

    async def kill(self) -> None:
        """Kill the process, which has nothing to save, and wait until it is gone."""
        with contextlib.suppress(ProcessLookupError):
            self._process.kill()
        self._requests.close()
        try:
            # `wait()` returns only when the pipe is closed, which needs a long answer to be read.
            while await self._answers.read(_READ_BYTES):
                pass
            await self._process.wait()
        except asyncio.CancelledError:  # as the event loop ends: nobody else would close the pipes
            self._process._transport.close()  # type: ignore[attr-defined]  # noqa: SLF001 — no public way
            await self._process.wait()  # soon, since it was killed and the pipes are closed
            raise
