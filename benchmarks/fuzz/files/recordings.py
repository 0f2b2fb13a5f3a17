"""Target for damaged recording sessions, read by the next service."""

from __future__ import annotations

import shutil
import zlib
from pathlib import Path
from random import Random

import msgspec

from benchmarks.fuzz.engine.event_loops import InlineExecutorLoop
from benchmarks.fuzz.engine.fed_site import CAMERAS, FedService, feed_epoch, site
from benchmarks.fuzz.engine.mutations import as_json, mutate_bytes, mutate_value
from benchmarks.fuzz.engine.target import ScriptTarget, folder
from benchmarks.fuzz.media.damaged_media import WORDS as MEDIA
from server.service.recording.recorder import Recorder
from server.service.recording.retention import RetentionLimits, RetentionPolicy
from server.service.recording.session_files import INFO_FILE
from server.service.time_shift.availability import (
    available_camera_ranges,
    available_ranges,
    end_of_available,
    first_available,
)
from server.service.time_shift.decision_log import read_decision_lines
from server.service.time_shift.playback import (
    CameraPlayback,
    PersonPlayback,
    PlaybackSource,
    last_gop_until,
    play_gops,
    recorded_audio,
)

WORDS = (
    b"\n", b"\x00", b"\xff", b"..", b"../../../precious", b"/", b"9" * 15, b"99999999999", b"-1", b"0",
    b"nan", b"1e308", b"1e-300", b"null", b"[]", b"{}", b'"c9"', b'"\\u0000"', b'"' + b"c" * 300 + b'"',
    b"p0+0", b"p5+5", b"[" * 2000,
)  # fmt: skip
_EPOCHS = 6
_FAR = 10_000
_MAX_GOPS = 40
_PULSE0 = 1_700_000_000.0
_DELETE_EVERY = 16
_LONG_S = 1e9
_Files = list[tuple[str, bytes]]
_files = msgspec.msgpack.Decoder(_Files)


class RecordedRuns(ScriptTarget):
    """Target for a recording session: its listing, playback and removal, which removes nothing else."""

    name = "recordings-sessions"

    def __init__(self) -> None:
        self._loop = InlineExecutorLoop()
        self._folder = folder()
        self._path = Path(self._folder.name)
        self._precious = self._path / "precious" / "000000000000.mp4"
        self._config = site(record={"folder": str(self._path / "kept"), "segment_s": 0.4})
        self._service = self._loop.run_until_complete(self._record())
        (self._run,) = (self._path / "kept").glob("2*")
        files = sorted(path for path in self._run.rglob("*") if path.is_file())
        self._valid = {str(file.relative_to(self._run)): file.read_bytes() for file in files}
        when = {
            "started": _PULSE0,
            "person_numbers_since": _PULSE0,
            "age_clock": "",
            "age_clock_at_pulse0": 1.0,
        }  # so that inputs are the same in every run
        self._valid[INFO_FILE] = as_json({**msgspec.json.decode(self._valid[INFO_FILE]), **when})
        self._kinds = {
            file.suffix: [name for name in self._valid if name.endswith(file.suffix)] for file in files
        }
        self._restore()

    async def _record(self) -> FedService:
        service, rng = FedService(self._config), Random(1)
        service.pulses.pulse0 = _PULSE0
        service.recorder.open()
        for epoch in range(_EPOCHS):
            feed_epoch(service, rng, epoch, _EPOCHS)
        service.close()
        return service

    def _restore(self) -> None:
        shutil.rmtree(self._path / "kept", ignore_errors=True)
        self._precious.parent.mkdir(exist_ok=True)
        self._precious.write_bytes(b"unrelated")
        for name, data in self._valid.items():
            (self._run / name).parent.mkdir(parents=True, exist_ok=True)
            (self._run / name).write_bytes(data)

    def make(self, rng: Random) -> bytes:
        """Return damaged files."""
        files: _Files = []
        for kind in rng.sample(sorted(self._kinds), rng.choice((1, 1, 1, 2))):
            name = rng.choice(self._kinds[kind])
            data = self._valid[name]
            if name.endswith(".json") and rng.random() < 0.6:
                files.append((name, as_json(mutate_value(rng, msgspec.json.decode(data)))))
            else:
                files.append((name, mutate_bytes(rng, data, MEDIA if name.endswith(".mp4") else WORDS)))
        return msgspec.msgpack.encode(files)

    def feed(self, data: bytes) -> bool:
        """Find the session, play it as a viewer would, and remove it."""
        files = _files.decode(data)
        for name, content in files:
            self.messages += 1
            (self._run / name).write_bytes(content)
        service = self._service
        recorder = Recorder(
            self._config, service.frame_buffers, service.stream_format, 10, service.audio_buffer
        )
        recorder.pulse0 = _PULSE0
        store = recorder.folder
        assert store is not None
        store.open()
        checksum = zlib.crc32(data)
        deletes = checksum % _DELETE_EVERY == 0
        try:
            found = bool(store.earlier)
            if found:
                store.session = store.earlier.pop()
                played = bool(
                    self._loop.run_until_complete(self._play_back(recorder, checksum // _DELETE_EVERY))
                )
            if deletes:
                size = sum(run.size for run in (*store.earlier, *([store.session] if store.session else [])))
                for bounds in (
                    RetentionLimits(_LONG_S, (size - 1) * 8 / 7 / 1e6, 60.0),
                    RetentionLimits(-_LONG_S, 1e6, 60.0),
                ):
                    store._retention = RetentionPolicy(
                        bounds, lambda: store._clock.now
                    )  # the oldest segment is deleted, then all
                    store._apply_retention()
                assert self._precious.exists(), "an unrelated file was deleted"
        finally:
            store.close()
            if deletes:
                self._restore()
            else:
                for name, _ in files:
                    (self._run / name).write_bytes(self._valid[name])
        return found and played

    @staticmethod
    async def _play_back(recorder: Recorder, checksum: int) -> int:
        """List everything, and play one camera and one person."""
        assert recorder.session is not None
        lines = [line async for line in read_decision_lines(recorder, 0, _FAR)]
        sources: tuple[PlaybackSource, ...] = (
            CameraPlayback(recorder, CAMERAS[checksum % 2]),
            PersonPlayback(recorder, (1 + checksum // 2 % 2,)),
        )
        for source in sources:
            available_ranges(source, 0, _FAR)
            available_camera_ranges(source)
            first_available(source, 3)
            end_of_available(source)
            count = 0
            async for _ in play_gops(source, 0):
                count += 1
                if count == _MAX_GOPS:
                    break
            await last_gop_until(source, 12)
        recorded_audio(recorder)
        return len(lines)

    def close(self) -> None:
        """Remove the folder."""
        self._loop.close()
        self._folder.cleanup()


TARGETS = (RecordedRuns,)
