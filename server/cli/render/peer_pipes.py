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

    Nobody gets ahead of another by more than one frame, and two words fit into a pipe: telling never
    waits for somebody who tells, too.
    """

    tell: dict[str, Connection] = field(default_factory=dict)
    hear: dict[str, Connection] = field(default_factory=dict)

    def exchange(self, detections: FrameDetections) -> Sequence[FrameDetections]:
        """Send this camera's detections in a frame; return those of the peers that have not ended."""
        data = msgspec.json.encode(detections)
        for camera, connection in list(self.tell.items()):
            try:
                connection.send_bytes(data)
            except OSError:  # it has ended, and closed its pipes
                del self.tell[camera]
        if detections.ended:
            return ()
        return [received for camera in list(self.hear) if (received := self._hear(camera)) is not None]

    def _hear(self, camera: str) -> FrameDetections | None:
        try:
            word = _DECODER.decode(self.hear[camera].recv_bytes())
        except EOFError:  # it failed: whoever started it will say so
            word = None
        if word is None or word.ended:
            del self.hear[camera]
            return None
        return word


class PeerPipeFactory:
    """Lays the pipes between cameras that are started one after the other.

    Open are only those that somebody still has to be given: of very many cameras all would be too many.
    """

    def __init__(self, others: Mapping[str, Sequence[str]]) -> None:
        self._others = others
        self._laid: dict[str, PeerPipes] = {camera: PeerPipes() for camera in others}
        self._given: set[str] = set()

    @contextmanager
    def of(self, camera: str) -> Iterator[PeerPipes]:
        """Return the ends of a camera's pipes, while its process starts; they are its own from then on."""
        own = self._laid[camera]
        for other in self._others[camera]:
            if other not in self._given:
                peer = self._laid[other]
                own.hear[other], peer.tell[camera] = multiprocessing.Pipe(duplex=False)
                peer.hear[camera], own.tell[other] = multiprocessing.Pipe(duplex=False)
        try:
            yield own
        finally:
            self._given.add(camera)
            for connection in (*own.tell.values(), *own.hear.values()):
                connection.close()
