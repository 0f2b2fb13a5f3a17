"""The association of an epoch's tracks while it runs in a thread, so that viewers are served meanwhile."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

from bestview import IdentityUpdate
from server.service.identity.camera_window import CameraWindow

Association = Callable[[], IdentityUpdate]
Run = Callable[[Association], Future[IdentityUpdate]]


@dataclass(slots=True, eq=False)
class EpochAssociation:
    """The association of an epoch's tracks.

    Attributes:
        last: the epoch's last frame.
        late: its late revisions.
        windows: its windows.
        numbers: has the result once it has ended.
        is_taken: whether the result has been taken.
    """

    last: int
    late: Sequence[CameraWindow]
    windows: Sequence[CameraWindow]
    numbers: Future[IdentityUpdate]
    is_taken: bool = False

    async def wait(self) -> None:
        """Wait for its end; an error is raised by whoever asks for the numbers."""
        ended = asyncio.wrap_future(self.numbers)
        ended.add_done_callback(lambda future: future.cancelled() or future.exception())
        await asyncio.wait([ended])


class AssociationThread:
    """A thread that associates one epoch after the other."""

    @cached_property
    def _pool(self) -> ThreadPoolExecutor:
        return ThreadPoolExecutor(1, thread_name_prefix="identity")

    def run(self, association: Association) -> Future[IdentityUpdate]:
        """Run an association in the thread."""
        return self._pool.submit(association)


def run_here(association: Association) -> Future[IdentityUpdate]:
    """Run an association at once."""
    future: Future[IdentityUpdate] = Future()
    future.set_result(association())
    return future
