"""Pipes between offline camera workers, over which they exchange detections in lockstep."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Protocol

import msgspec

from server.messaging.messages import FrameDetections

_DECODER = msgspec.json.Decoder(FrameDetections)


class PeerLink(Protocol):
    """The link of one camera to its peers, in lockstep."""

    def exchange(self, detections: FrameDetections) -> Sequence[FrameDetections]:
        """Send this camera's detections in a frame; return those of its peers."""
        ...


@dataclass(slots=True)
class PeerPipes:
    """One camera's ends of the pipes, in the order of the configuration.

    No camera gets ahead of another by more than one frame, and two messages fit into a pipe: sending never
    blocks on a peer that is sending, too.
    """

    outgoing: dict[str, Connection] = field(default_factory=dict)
    incoming: dict[str, Connection] = field(default_factory=dict)

    def exchange(self, detections: FrameDetections) -> Sequence[FrameDetections]:
        """Send this camera's detections in a frame; return those of the peers that have not ended."""
        data = msgspec.json.encode(detections)
        for camera, connection in list(self.outgoing.items()):
            try:
                connection.send_bytes(data)
            except OSError:  # it has ended, and closed its pipes
                del self.outgoing[camera]
        if detections.ended:
            return ()
        return [received for camera in list(self.incoming) if (received := self._receive(camera)) is not None]

    def _receive(self, camera: str) -> FrameDetections | None:
        try:
            detections = _DECODER.decode(self.incoming[camera].recv_bytes())
        except EOFError:  # it failed, which its starter reports
            detections = None
        if detections is None or detections.ended:
            del self.incoming[camera]
            return None
        return detections


class PeerPipeFactory:
    """Creates the pipes between cameras that are started one after the other.

    Only pipes that are not handed over yet are open here: all pipes of very many cameras would be too many.
    """

    def __init__(self, others: Mapping[str, Sequence[str]]) -> None:
        self._others = others
        self._pipes: dict[str, PeerPipes] = {camera: PeerPipes() for camera in others}
        self._handed_over: set[str] = set()

    @contextmanager
    def of(self, camera: str) -> Iterator[PeerPipes]:
        """Yield the ends of a camera's pipes while its process starts; they are closed here afterwards."""
        own = self._pipes[camera]
        for other in self._others[camera]:
            if other not in self._handed_over:
                peer = self._pipes[other]
                own.incoming[other], peer.outgoing[camera] = multiprocessing.Pipe(duplex=False)
                peer.incoming[camera], own.outgoing[other] = multiprocessing.Pipe(duplex=False)
        try:
            yield own
        finally:
            self._handed_over.add(camera)
            for connection in (*own.outgoing.values(), *own.incoming.values()):
                connection.close()
