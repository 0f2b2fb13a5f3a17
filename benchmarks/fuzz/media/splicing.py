"""Targets for splicing: access units of two cameras, some damaged, in every stream format."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from random import Random

import msgspec

from benchmarks.fuzz.bus.messages import drain, read_api
from benchmarks.fuzz.engine.fed_site import (
    CAMERAS,
    FPS,
    STRIDE,
    FedService,
    make_tracks,
    pictures,
    site,
    tracks,
    video,
)
from benchmarks.fuzz.engine.target import ScriptTarget
from benchmarks.fuzz.media.damaged_media import damage_media
from server.camera.encoder import AccessUnit
from server.config.site_config import Config
from server.media.picture import Codec
from server.messaging.epochs import end_of_epoch
from server.service.streaming.broadcaster import Broadcaster
from server.service.view_selection.decider import GopDecision, ObjectChoice

_EPOCHS = 4
_FRAMES = _EPOCHS * STRIDE
_PEOPLE = (1, 2)
_WHOLE_SHARE = 1 / 64
"""Share of inputs with the service's decisions, which are ten times slower."""
_Cuts = list[tuple[int | None, int | None]]
"""For each GOP: the cameras of two people; empty: the service decides."""
_Units = list[tuple[int, int, bytes]]
"""Camera, pulse, access unit."""
_script = msgspec.msgpack.Decoder(tuple[_Cuts, _Units])


class _Splice(ScriptTarget):
    """Frames of two cameras, and the cuts between them in people's streams."""

    codec: Codec = "h264"
    parameters = "equal"

    def __init__(self) -> None:
        self._pictures = [pictures(seed, _FRAMES, self.codec) for seed in range(len(CAMERAS))]
        self._config = self._site()
        self._loop = asyncio.new_event_loop()
        self._decided: list[GopDecision] = []
        right = [
            (camera, pulse, units[pulse].data)
            for pulse in range(_FRAMES)
            for camera, units in enumerate(self._pictures)
        ]
        self._loop.run_until_complete(self._whole(right))

    def _site(self) -> Config:
        encode = {"gop_s": STRIDE / FPS, "codec": self.codec, "parameters": self.parameters}
        return site(codec=self.codec, encode=encode)

    def make(self, rng: Random) -> bytes:
        """Return frames of two cameras in the order of their pulses."""
        share = rng.choice((0.05, 0.1, 0.3))
        whole = rng.random() < _WHOLE_SHARE
        gops = _EPOCHS if whole else rng.choice((2, 2, 3))
        views = (0, 0, 1, 1, None)
        cuts: _Cuts = [] if whole else [(rng.choice(views), rng.choice(views)) for _ in range(gops)]
        script: _Units = []
        for pulse in range(gops * STRIDE):
            for camera, units in enumerate(self._pictures):
                data = units[pulse].data
                if rng.random() < share:
                    data = damage_media(rng, data) if rng.random() < 0.9 else b""
                if rng.random() > share / 4:
                    script.append((camera, pulse, data))
        return msgspec.msgpack.encode((cuts, script))

    def feed(self, data: bytes) -> bool:
        """Splice the frames."""
        cuts, units = _script.decode(data)
        return self._loop.run_until_complete(self._cut(cuts, units) if cuts else self._whole(units))

    async def _whole(self, units: _Units) -> bool:
        """Decide by track messages, and read the whole API."""
        service, rng = FedService(self._config), Random(1)
        published, self._decided = service._publish, []

        def publish(decision: GopDecision) -> None:
            self._decided.append(decision)
            published(decision)

        service._publish = publish  # type: ignore[method-assign]  # the template of later decisions
        viewers = [broadcaster.subscribe() for broadcaster in _broadcasters(service)]
        for epoch in range(_EPOCHS):
            self._show(service, units, epoch)
            for name in CAMERAS:
                service.handle(tracks(make_tracks(rng, name, epoch)))
            service.pulses.newest = end_of_epoch(epoch, STRIDE)
            service.decide()
        read_api(service)
        for viewer in viewers:
            drain(viewer)
        return not any(state.refused for state in service.ingest.states.values())

    async def _cut(self, cuts: _Cuts, units: _Units) -> bool:
        """Cut where the input says, also to pictures that never arrived."""
        service = FedService(self._config)
        viewers = [broadcaster.subscribe() for broadcaster in _broadcasters(service)]
        before: dict[int, str | None] = dict.fromkeys(_PEOPLE)
        for gop, chosen in enumerate(cuts):
            self._show(service, units, gop)
            now = {
                number: None if camera is None else CAMERAS[camera]
                for number, camera in zip(_PEOPLE, chosen, strict=True)
            }
            choices = tuple(
                ObjectChoice(person, now[person], before[person], now[person] is None) for person in _PEOPLE
            )
            decision = replace(
                self._decided[0], first=gop * STRIDE, choices=choices, merged={}, corrections=()
            )
            service.recorder.put(service.decision_state.put(decision), None)
            service.splicer.publish_decision(decision)
            if gop == 0:
                viewers += [person.subscribe() for person in service.splicer.persons.values()]
            before = now
        for viewer in viewers:
            drain(viewer)
        return not any(state.refused for state in service.ingest.states.values())

    def _show(self, service: FedService, units: _Units, gop: int) -> None:
        for camera, pulse, data in units:
            if pulse // STRIDE == gop:
                self.messages += 1
                unit = AccessUnit(pulse=pulse, key=pulse % STRIDE == 0, data=data)
                service.handle(video(CAMERAS[camera], unit))

    def close(self) -> None:
        """Close the loop."""
        self._loop.close()


def _broadcasters(service: FedService) -> list[Broadcaster]:
    return [*service.splicer.cameras.values(), *service.splicer.decided_cameras.values()]


class Splice(_Splice):
    """H.264 with shared parameter sets."""

    name = "media-splice"


class SplicePassthrough(_Splice):
    """H.264 with each camera's own parameter sets."""

    name = "media-splice-own"
    parameters = "own"


class SpliceVp8(_Splice):
    """VP8."""

    name = "media-splice-vp8"
    codec = "vp8"


class SpliceH265(_Splice):
    """H.265 with each camera's own parameter sets."""

    name = "media-splice-h265"
    codec = "h265"
    parameters = "own"
