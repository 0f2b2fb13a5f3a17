"""Media with damaged packets: from cameras through the splice, in files, and as a client reads them."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Iterable
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import BinaryIO, ClassVar, Literal

import av
import msgspec
import numpy as np

from benchmarks.fuzz_mutate import damaged
from benchmarks.fuzz_site import (
    CAMERAS,
    FPS,
    HEIGHT,
    STRIDE,
    WIDTH,
    Fed,
    pictures,
    site,
    tracks,
    video,
    word,
)
from benchmarks.fuzz_target import Target, folder, refused
from benchmarks.fuzz_zenoh import ask, drink
from client.fmp4 import BoxReader, Mp4Error
from client.plain import write_plain
from client.recording import Recording as ClientRecording
from client.sse import EventStreamError, SseParser
from client.webm import ElementReader, WebmError
from client.webm_recording import WebmRecording, write_indexed
from server.camera.encode import AccessUnit
from server.camera.own.annexb import packing_of
from server.camera.own.fitting import MisfitError, Wanted
from server.camera.own.recording import OwnRecording
from server.camera.sources.base import SourceEnded
from server.camera.sources.recording import Recording
from server.draw.studio import Studio
from server.view.past.media import gops
from server.view.past.playlist import Playlist
from server.view.past.sounds import frames_in
from server.view.vp8 import Vp8Agreement
from server.wire.config import Config
from server.wire.drawing import Canvas, Draw
from server.wire.epochs import end_of_epoch
from server.wire.errors import UserError
from server.wire.sections import Site
from server.wire.sound import SoundFormat

WORDS = (
    b"\x00\x00\x01", b"\x00\x00\x00\x01", b"\x00\x00\x01\x67", b"\x00\x00\x01\x68", b"\x00\x00\x01\x65",
    b"\x00\x00\x03", b"\x00" * 40, b"\xff" * 40, b"\x00\x00\x00\x00", b"\x00\x00\x00\x08",
    b"\x7f\xff\xff\xff", b"\xff\xff\xff\xff", b"\x00\x00\x00\x01\xff\xff\xff\xff\xff\xff\xff\xff", b"moof",
    b"mdat", b"moov", b"trak", b"tfdt", b"trun", b"soun", b"\x1f\x43\xb6\x75", b"\x18\x53\x80\x67",
    b"\xe7\x88", b"\xa3\x81", b"\xa0\x81", b"\x01\xff\xff\xff\xff\xff\xff\xff", b"\x9d\x01\x2a",
)  # fmt: skip
_EPOCHS = 4
_FRAMES = _EPOCHS * STRIDE
_Script = list[tuple[int, int, bytes]]
"""Camera, pulse, access unit."""
_script = msgspec.msgpack.Decoder(_Script)


def _wrong(rng: Random, data: bytes) -> bytes:
    return damaged(rng, data, WORDS)


class _Splice(Target):
    """Access units of two cameras, some damaged, through a site's streams in every form."""

    share = 0.02
    codec: Literal["h264", "vp8"] = "h264"
    parameters = "equal"

    def __init__(self) -> None:
        self._pictures = [pictures(seed, _FRAMES, self.codec) for seed in range(len(CAMERAS))]
        self._config = self._site()
        self._loop = asyncio.new_event_loop()

    def _site(self) -> Config:
        encode = {"gop": STRIDE, "codec": self.codec, "parameters": self.parameters}
        return site(codec=self.codec, encode=encode)

    def make(self, rng: Random) -> bytes:
        """Give two cameras' frames in the order of their pulses."""
        share = rng.choice((0.05, 0.05, 0.3))
        script: _Script = []
        for pulse in range(_FRAMES):
            for camera, units in enumerate(self._pictures):
                data = units[pulse].data
                if rng.random() < share:
                    data = _wrong(rng, data) if rng.random() < 0.9 else b""
                if rng.random() > share / 4:
                    script.append((camera, pulse, data))
        return msgspec.msgpack.encode(script)

    def feed(self, data: bytes) -> bool:
        """Splice them."""
        return self._loop.run_until_complete(self._spliced(_script.decode(data)))

    async def _spliced(self, script: _Script) -> bool:
        service, rng = Fed(self._config), Random(1)
        viewers = [it.join() for it in (*service.splicer.cameras.values(), *service.splicer.decided.values())]
        for epoch in range(_EPOCHS):
            for camera, pulse, data in script:
                if pulse // STRIDE == epoch:
                    unit = AccessUnit(pulse=pulse, key=pulse % STRIDE == 0, data=data)
                    service.handle(video(CAMERAS[camera], unit))
            for name in CAMERAS:
                service.handle(tracks(word(rng, name, epoch)))
            service.pulse = end_of_epoch(epoch, STRIDE)
            service.decide()
        ask(service)
        for viewer in viewers:
            drink(viewer)
        return not any(it.refused for it in service.intake.states.values())

    def close(self) -> None:
        """Close the loop."""
        self._loop.close()


class Splice(_Splice):
    """H.264 of one set of parameters."""

    name = "media-splice"


class SpliceOwn(_Splice):
    """H.264 whose parameter sets are each camera's own."""

    name = "media-splice-own"
    parameters = "own"


class SpliceVp8(_Splice):
    """VP8."""

    name = "media-splice-vp8"
    codec = "vp8"


def _stream(codec: Literal["h264", "vp8"]) -> bytes:
    """Give a stream of some GOPs as a viewer is sent it."""
    agreement = Vp8Agreement(WIDTH, HEIGHT) if codec == "vp8" else None
    form, units = SoundFormat(48_000, 2), pictures(0, 10, codec)
    if agreement is None:
        from server.view.agreement import Agreement  # noqa: PLC0415 — its neighbour of H.264
        from server.view.mp4_sound import sound_fragment  # noqa: PLC0415

        found = Agreement()
        found.accept(units[0].data)
        head = found.head(Site(width=WIDTH, height=HEIGHT, fps=FPS), form) or b""
        sound = sound_fragment(form, [form.silence] * 9, 0)
        return head + sound + b"".join(found.pack(it.data, it.pulse, FPS, key=it.key) for it in units)
    head = agreement.head(Site(width=WIDTH, height=HEIGHT, fps=FPS))
    return head + b"".join(agreement.pack(it.data, it.pulse, FPS, key=it.key) for it in units)


class _Film(Target):
    """A stream that a client reads in pieces, and makes a file of."""

    codec: ClassVar[Literal["h264", "vp8"]]
    error: ClassVar[type[Exception]]

    def __init__(self) -> None:
        self._stream = _stream(self.codec)
        self._folder = folder()
        self._path = Path(self._folder.name)

    def make(self, rng: Random) -> bytes:
        """Give a stream."""
        return _wrong(rng, self._stream)

    def feed(self, data: bytes) -> bool:
        """Read it in pieces, and record it."""
        part = self._path / "film.part"
        try:
            with part.open("wb") as file:
                self.record((data[at : at + 1500] for at in range(0, len(data), 1500)), file)
        except self.error as error:
            refused(error)
        try:
            self.finish(part)
        except self.error as error:
            return refused(error)
        return True

    def record(self, pieces: Iterable[bytes], file: BinaryIO) -> None:
        """Write what comes as it comes."""
        raise NotImplementedError

    def finish(self, part: Path) -> None:
        """Make the file that plays everywhere of it."""
        raise NotImplementedError

    def close(self) -> None:
        """Take the folder away."""
        self._folder.cleanup()


class ClientMp4(_Film):
    """What `myview watch` is sent, and makes a file of."""

    name = "media-mp4"
    codec = "h264"
    error = Mp4Error

    def record(self, pieces: Iterable[bytes], file: BinaryIO) -> None:
        """Write what comes as it comes."""
        reader, taken = BoxReader(), ClientRecording(file, 10.0)
        for piece in pieces:
            for box in reader.feed(piece):
                taken.take(box)

    def finish(self, part: Path) -> None:
        """Make the file that plays everywhere of it."""
        write_plain(part, part.with_suffix(".mp4"))


class ClientWebm(_Film):
    """The same of WebM."""

    name = "media-webm"
    codec = "vp8"
    error = WebmError

    def record(self, pieces: Iterable[bytes], file: BinaryIO) -> None:
        """Write what comes as it comes."""
        reader, taken = ElementReader(), WebmRecording(file, 10.0)
        for piece in pieces:
            for element in reader.feed(piece):
                taken.take(element)

    def finish(self, part: Path) -> None:
        """Make the file that can be looked through of it."""
        write_indexed(part, part.with_suffix(".webm"))


class Events(Target):
    """Server-sent events, as the client reads them."""

    name = "media-events"
    _SENT = b'event: gop\nid: 7\ndata: {"first": 5, "frames": 5}\n\n: hello\r\ndata: a\rdata: b\n\n'

    def make(self, rng: Random) -> bytes:
        """Give a stream of events."""
        return damaged(rng, self._SENT)

    def feed(self, data: bytes) -> bool:
        """Read it in pieces."""
        whole, pieces = SseParser(), SseParser()
        try:
            events = whole.feed(data)
            step = 1 + len(data) % 7
            cut = [it for at in range(0, len(data), step) for it in pieces.feed(data[at : at + step])]
        except EventStreamError as error:
            return refused(error)
        assert cut == events, "how a stream is cut changes what it says"
        return True


class OwnPackets(Target):
    """What a camera's own H.264 is packed in."""

    name = "media-packets"

    def __init__(self) -> None:
        units = pictures(0, 2)
        sps = b"\x67\x42\xc0\x1e\xd9"
        avcc = b"\x01\x42\xc0\x1e\xff\xe1" + struct.pack(">H", len(sps)) + sps + b"\x01\x00\x02\x68\xce"
        lengths = b"".join(struct.pack(">I", len(it)) + it for it in (b"\x65\x88\x84", b"\x41\x9a"))
        self._right = ((avcc, lengths), (units[0].data[:40], units[1].data), (b"", units[0].data))

    def make(self, rng: Random) -> bytes:
        """Give what stands beside a stream, and a packet of it."""
        beside, packet = rng.choice(self._right)
        beside = _wrong(rng, beside) if rng.random() < 0.6 else beside
        packet = _wrong(rng, packet) if rng.random() < 0.6 else packet
        return msgspec.msgpack.encode((beside, packet))

    def feed(self, data: bytes) -> bool:
        """Unpack it."""
        beside, packet = msgspec.msgpack.decode(data, type=tuple[bytes, bytes])
        try:
            packing_of(beside).annex_b(packet)
        except ValueError as error:
            return refused(error)
        return True


class Drawing(Target):
    """Streams whose pictures are decoded and drawn on."""

    name = "media-drawing"
    share = 0.005

    def __init__(self) -> None:
        self._units = pictures(0, 10)
        self._fragments = _stream("h264")

    def make(self, rng: Random) -> bytes:
        """Give fragments."""
        return _wrong(rng, self._fragments)

    def feed(self, data: bytes) -> bool:
        """Draw them."""
        canvas = Canvas(
            width=WIDTH,
            height=HEIGHT,
            fps=FPS,
            gop=STRIDE,
            preset="ultrafast",
            crf=23,
            max_kbps=None,
            jpeg_quality=80,
        )
        boxes = [[(1, 2.0, 3.0, 20.0, 40.0)]] * 10
        drawn = Studio(canvas).draw(Draw(fragments=data, boxes=boxes, film=True, boxed=[5.0], still="plain"))
        return drawn.newest >= 0


class Files(Target):
    """A recording, opened as a camera's source: each frame in its place however damaged the file is."""

    name = "media-files"
    share = 0.005

    def __init__(self) -> None:
        self._folder = TemporaryDirectory()  # what is below /dev would be taken for a camera
        self._path = Path(self._folder.name) / "c0.mp4"
        with av.open(str(self._path), "w") as out:
            stream = out.add_stream(
                "libx264", rate=FPS, options={"preset": "ultrafast", "g": "5", "bf": "0", "sc_threshold": "0"}
            )
            stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
            rng = np.random.default_rng(1)
            for _ in range(10):
                image = np.repeat(rng.integers(0, 255, (HEIGHT, WIDTH // 8, 3), dtype=np.uint8), 8, axis=1)
                out.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24")))
            out.mux(stream.encode())
        self._file = self._path.read_bytes()

    def make(self, rng: Random) -> bytes:
        """Give a file."""
        return _wrong(rng, self._file)

    def feed(self, data: bytes) -> bool:
        """Take its frames; then those that are passed on as they are."""
        self._path.write_bytes(data)
        wanted = Wanted((WIDTH, HEIGHT), FPS, STRIDE, None)
        try:
            recording = Recording(str(self._path), 0, "stop")
        except UserError as error:
            return refused(error)
        try:
            for pulse in range(12):
                recording.take(pulse)
        except SourceEnded:
            pass
        finally:
            recording.close()
        try:
            own = OwnRecording(str(self._path), 0, "stop", wanted)
        except (UserError, MisfitError) as error:
            return refused(error)
        try:
            for pulse in range(12):
                own.take(pulse)
        except SourceEnded:
            pass
        finally:
            own.close()
        return True

    def close(self) -> None:
        """Take the folder away."""
        self._folder.cleanup()


class Kept(Target):
    """What was recorded, read again after somebody has damaged it."""

    name = "media-kept"
    share = 0.2
    _LIST = (
        b"#EXTM3U\n#EXTINF:0.2,p0+5\n#EXT-X-BYTERANGE:400@0\n../cameras/c0/000000000000.mp4\n"
        b"#EXTINF:0.2,p5+5\n#EXT-X-BYTERANGE:400@400\n../cameras/c1/000000000000.mp4\n#EXT-X-ENDLIST\n"
    )

    def __init__(self) -> None:
        self._stream = _stream("h264")
        self._folder = folder()
        self._path = Path(self._folder.name)
        self._form = SoundFormat(48_000, 2)

    def make(self, rng: Random) -> bytes:
        """Give a playlist, or a file of pictures and sound."""
        return _wrong(rng, rng.choice((self._LIST, self._stream)))

    def feed(self, data: bytes) -> bool:
        """Find pictures and sound in it."""
        path = self._path / "0.mp4"
        path.write_bytes(data)
        playlist = Playlist(path, "../cameras/", "init.mp4", FPS, 0.0, 60.0)
        playlist.read()
        for stretch in playlist.tape.between(0, 100):
            list(gops(path, stretch.offset, stretch.length, FPS, 5))
        found = list(gops(path, 0, len(data), FPS, 5))
        frames_in(path, 0, len(data), 0, 20, self._form)
        return bool(found)

    def close(self) -> None:
        """Take the folder away."""
        self._folder.cleanup()


TARGETS = (
    Splice,
    SpliceOwn,
    SpliceVp8,
    ClientMp4,
    ClientWebm,
    Events,
    OwnPackets,
    Kept,
    Drawing,
    Files,
)
