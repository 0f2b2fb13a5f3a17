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

_DECODER = msgspec.msgpack.Decoder(FrameDetections)


class PeerLink(Protocol):
    """The link of one camera to its peers, in lockstep."""

    def exchange(self, detections: FrameDetections) -> Sequence[FrameDetections]:
        """Send this camera's detections in a frame; return those of its peers."""
        ...


@dataclass(slots=True)
class PeerPipes:
    """One camera's ends of the pipes, in the order of the configuration.

    No camera is ahead of another by more than one frame, and a pipe holds two messages, so two peers that
    send to each other never block.
    """

    outgoing: dict[str, Connection] = field(default_factory=dict)
    incoming: dict[str, Connection] = field(default_factory=dict)

    def exchange(self, detections: FrameDetections) -> Sequence[FrameDetections]:
        """Send this camera's detections in a frame; return those of the peers that have not ended."""
        data = msgspec.msgpack.encode(detections)
        for camera, connection in list(self.outgoing.items()):
            try:
                connection.send_bytes(data)
            except OSError:  # the peer has ended and closed its pipes
                del self.outgoing[camera]
        if detections.ended:
            return ()
        return [received for camera in list(self.incoming) if (received := self._receive(camera)) is not None]

    def _receive(self, camera: str) -> FrameDetections | None:
        try:
            detections = _DECODER.decode(self.incoming[camera].recv_bytes())
        except EOFError:  # the peer has failed; the parent reports it
            detections = None
        if detections is None or detections.ended:
            del self.incoming[camera]
            return None
        return detections


class PeerPipeFactory:
    """Creates the pipes between cameras that are started one after the other.

    Only pipes that have not been passed to a process are open here, to stay below the limit of descriptors.
    """

    def __init__(self, peers: Mapping[str, Sequence[str]]) -> None:
        self._peers = peers
        self._pipes: dict[str, PeerPipes] = {camera: PeerPipes() for camera in peers}
        self._handed_over: set[str] = set()

    @contextmanager
    def open_while_starting(self, camera: str) -> Iterator[PeerPipes]:
        """Yield a camera's ends of the pipes while its process starts; they are closed here afterwards."""
        own_pipe = self._pipes[camera]
        for peer_name in self._peers[camera]:
            if peer_name not in self._handed_over:
                peer = self._pipes[peer_name]
                own_pipe.incoming[peer_name], peer.outgoing[camera] = multiprocessing.Pipe(duplex=False)
                peer.incoming[camera], own_pipe.outgoing[peer_name] = multiprocessing.Pipe(duplex=False)
        try:
            yield own_pipe
        finally:
            self._handed_over.add(camera)
            for connection in (*own_pipe.outgoing.values(), *own_pipe.incoming.values()):
                connection.close()
