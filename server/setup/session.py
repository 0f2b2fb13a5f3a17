"""The state of a set-up: cameras that were found, their streams, and those that were tried and taken."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
from collections.abc import AsyncIterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from server.config.loader import check_section
from server.config.sections import SiteSettings
from server.setup import discovery
from server.setup.camera_address import CameraAddress, CameraAddresses, check_name, free_name, parse_address
from server.setup.discovery import FoundCamera
from server.setup.own_video import NOT_COMPARED, OwnVideo, compare_own_video
from server.setup.proposal import SiteProposal, propose_site
from server.setup.site_file import NewCamera, NewSite, write_site
from server.setup.trial_messages import (
    ProfileList,
    ProfilesRequest,
    StreamRequest,
    StreamTrial,
    list_profiles,
    try_stream,
)
from server.system.errors import UserError

DISCOVERY_S = 3.0
MAX_CAMERAS = 64
"""Most cameras of a set-up."""
_TRIALS_AT_ONCE = 2
"""Trials that run at a time; each decodes video."""
_MAX_WAITING = 16
_MAX_FOUND = 1024
"""Found cameras that are remembered, the latest."""
_MAX_STREAMS = 4096
"""Offered streams that are remembered, the latest: a site may run for months."""


@dataclass(frozen=True, slots=True)
class TriedStream:
    """A stream that sends pictures."""

    address: CameraAddress
    trial: StreamTrial

    @property
    def sends(self) -> str:
        """What it sends, in a few words."""
        rate = f", {self.trial.fps:g} fps" if self.trial.fps else ""
        return f"{self.trial.codec} {self.trial.width}x{self.trial.height}{rate}"


@dataclass(frozen=True, slots=True)
class TriedCamera:
    """A camera that sends pictures, and its name in the site."""

    key: int
    name: str
    source: TriedStream
    substream: TriedStream | None = None
    """The one in which people are tracked."""

    @property
    def address(self) -> CameraAddress:
        """The address of what viewers get."""
        return self.source.address

    @property
    def trial(self) -> StreamTrial:
        """What viewers get."""
        return self.source.trial

    @property
    def sends(self) -> str:
        """What viewers get, in a few words."""
        return self.source.sends

    @property
    def tracked_in(self) -> str:
        """The substream in a few words; empty: there is none."""
        return "" if self.substream is None else self.substream.sends

    def as_new(self, name: str, own_video: OwnVideo = NOT_COMPARED) -> NewCamera:
        """Return the camera to write, under a name."""
        substream = None if self.substream is None else self.substream.address.source
        return NewCamera(name, self.address, self.sends, substream, self.tracked_in, own_video)


@dataclass(slots=True)
class SetupSession:
    """One set-up, in memory; ``path`` is the configuration file that it will write.

    A running site has one, too, to find and try cameras.
    """

    path: Path
    cameras: list[TriedCamera] = field(default_factory=list)
    kept: Path | None = None
    """Where the earlier file is, after writing."""
    written: asyncio.Event = field(default_factory=asyncio.Event)
    """Set when the configuration is written."""
    sizes: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Width and height of the pictures of sources that were tried, the latest."""
    _found: dict[tuple[str, int], FoundCamera] = field(default_factory=dict)
    """Cameras that any search has found, by address and port: several operators may search."""
    _streams: dict[int, CameraAddress] = field(default_factory=dict)
    """Streams that cameras offered, by key, with their passwords."""
    _keys: itertools.count[int] = field(default_factory=lambda: itertools.count(1))
    _trials: asyncio.Semaphore = field(default_factory=lambda: asyncio.Semaphore(_TRIALS_AT_ONCE))
    _queue: list[asyncio.Task[Any] | None] = field(default_factory=list)
    """Tasks that speak to a camera, or wait for that, in order."""

    async def discover(self, seconds: float = DISCOVERY_S) -> Sequence[FoundCamera]:
        """Look for cameras in the network.

        Raises:
            UserError: there is no network.
        """
        found = await discovery.discover(seconds)
        for camera in found:
            address = camera.host, camera.port
            self._found.pop(address, None)  # the latest is last
            self._found[address] = camera
        _keep_latest(self._found, _MAX_FOUND)
        return found

    async def profiles(
        self, host: str, port: int, user: str, password: str
    ) -> tuple[ProfileList, Sequence[int]]:
        """Ask a found camera for its streams; return them, and their keys for :meth:`offered`.

        Raises:
            UserError: no such camera was found, or too many are asked.
        """
        camera = self._found.get((host, port))
        if camera is None:
            raise UserError("no such camera was found; search again")
        request = ProfilesRequest(host, port, user, password, camera.encrypted)
        async with self._turn():
            answer = await list_profiles(request)
        keys = []
        for profile in answer.profiles:
            key = next(self._keys)
            self._streams[key] = parse_address(profile.address, user, password)
            keys.append(key)
        _keep_latest(self._streams, _MAX_STREAMS)
        return answer, keys

    def offered(self, source: int, substream: int | None = None) -> CameraAddresses:
        """Return the addresses of streams that a camera offered, by their keys.

        Raises:
            UserError: there is no such stream, or both are one.
        """
        if source not in self._streams or (substream is not None and substream not in self._streams):
            raise UserError("no such stream; ask the camera again")
        return CameraAddresses(self._streams[source], None if substream is None else self._streams[substream])

    async def add(self, addresses: CameraAddresses, name: str = "") -> TriedCamera:
        """Try a camera, and add it if all its streams send pictures.

        Raises:
            UserError: it is in the list already, or no picture arrives.
        """
        self._check_addable(addresses)
        camera = await self.try_camera(addresses, name)
        self._check_addable(addresses)  # others were added meanwhile
        camera = replace(camera, name=free_name(name, {camera.name for camera in self.cameras}))
        self.cameras.append(camera)
        return camera

    def _check_addable(self, addresses: CameraAddresses) -> None:
        if any(camera.address.source == addresses.source.source for camera in self.cameras):
            raise UserError(f"{addresses.source.shown}: this camera is in the list already")
        if len(self.cameras) >= MAX_CAMERAS:
            raise UserError(f"a site set up here has at most {MAX_CAMERAS} cameras")

    async def try_camera(
        self, addresses: CameraAddresses, name: str = "", passed_into: Path | None = None
    ) -> TriedCamera:
        """Try a camera without adding it to the list.

        Its own video must fit into the streams of the configuration ``passed_into``, if there is one.

        Raises:
            UserError: no picture arrives, or it does not fit.
        """
        small = addresses.substream
        async with self._turn():
            source = await self._tried(addresses.source, site="" if passed_into is None else str(passed_into))
            substream = None if small is None else await self._tried(small, "the substream: ")
        return TriedCamera(next(self._keys), name, source, substream)

    async def _tried(self, address: CameraAddress, which: str = "", site: str = "") -> TriedStream:
        trial = await try_stream(StreamRequest(address.with_password, address.options, site))
        if trial.error:
            raise UserError(f"{which}{address.shown}: {trial.error}")
        self.sizes[address.source] = trial.width, trial.height
        _keep_latest(self.sizes, _MAX_STREAMS)
        return TriedStream(address, trial)

    def trials_ahead(self, task: asyncio.Task[Any]) -> int:
        """Return how many of the cameras that are spoken to must be done before a task begins; 0: it has."""
        return max(0, self._queue.index(task) - _TRIALS_AT_ONCE + 1) if task in self._queue else 0

    @contextlib.asynccontextmanager
    async def _turn(self) -> AsyncIterator[None]:
        """Wait until few others are spoken to.

        Raises:
            UserError: too many wait already.
        """
        if len(self._queue) >= _MAX_WAITING:
            raise UserError("too many cameras are being tried; wait for them")
        task = asyncio.current_task()
        self._queue.append(task)
        try:
            async with self._trials:
                yield
        finally:
            self._queue.remove(task)

    def rename(self, key: int, name: str) -> None:
        """Rename a camera.

        Raises:
            UserError: there is none, or the name is invalid or taken.
        """
        camera = self.camera(key)
        check_name(name)
        if any(other.name == name and other.key != key for other in self.cameras):
            raise UserError(f"another camera is called {name}")
        self.cameras = [replace(one, name=name) if one is camera else one for one in self.cameras]

    def remove(self, key: int) -> None:
        """Remove a camera.

        Raises:
            UserError: there is none.
        """
        self.cameras.remove(self.camera(key))

    def camera(self, key: int) -> TriedCamera:
        """Return a camera.

        Raises:
            UserError: there is none.
        """
        for camera in self.cameras:
            if camera.key == key:
                return camera
        raise UserError("no such camera")

    @property
    def proposal(self) -> SiteProposal:
        """The proposed size and rate."""
        return propose_site([camera.trial for camera in self.cameras])

    def write(self, name: str, chosen: SiteProposal) -> None:
        """Write the configuration.

        Raises:
            UserError: there is no camera, a value is invalid, or the file cannot be written.
        """
        if not self.cameras:
            raise UserError("add a camera first")
        check_section(SiteSettings, {"name": name, **asdict(chosen)}, "site")
        cameras = [
            camera.as_new(camera.name, compare_own_video(camera.trial, chosen)) for camera in self.cameras
        ]
        self.kept = write_site(NewSite(name, chosen, cameras), self.path)
        self.written.set()


def _keep_latest(entries: dict[Any, Any], most: int) -> None:
    while len(entries) > most:
        del entries[next(iter(entries))]
