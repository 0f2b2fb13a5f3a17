"""Targets for MOTChallenge files: detections, tracks and ground truth, compressed or not."""

from __future__ import annotations

import gzip
from pathlib import Path
from random import Random

import numpy as np

from benchmarks.fuzz.engine.mutations import mutate_bytes
from benchmarks.fuzz.engine.target import Target, folder, refused
from server.cli.calibrate.walk_input import VideoFormat, walks_from_tracks
from server.system.errors import UserError
from tracking.detectors.mot_file import MotFileDetector
from tracking.motchallenge import MotRow, format_rows, parse_rows, read_rows

WORDS = (
    b",", b",,", b"\n", b"\r", b"\x00", b"\xff", b"\x1c", b"-1", b"0", b"nan", b"inf", b"-inf", b"1e308",
    b"1e-320", b"9" * 25, b"9" * 5000, b"1_0", b" 1 ", b"0x10", b"1e7", b"10000001", b"1.5", b"\xd9\xa1",
    b"," * 20,
)  # fmt: skip
_PACKED = b"\x1f\x8b"


def _rows(rng: Random, min_id: int) -> bytes:
    rows = [
        MotRow(
            frame=rng.randrange(1, 40),
            id=rng.randrange(min_id, 6),
            left=rng.uniform(-5, 300),
            top=rng.uniform(-5, 200),
            width=rng.uniform(1, 60),
            height=rng.uniform(1, 120),
            confidence=rng.choice((1.0, rng.random(), rng.uniform(-5, 90))),
        )
        for _ in range(rng.randrange(1, 12))
    ]
    return format_rows(rows).encode()


class _MotFiles(Target):
    """MOTChallenge files in a temporary folder."""

    min_id = -1

    def __init__(self) -> None:
        self._folder = folder()
        self._path = Path(self._folder.name)
        rng = Random(1)
        self._valid = [_rows(rng, self.min_id) for _ in range(200)]

    def file(self, rng: Random) -> bytes:
        """Return a slightly damaged file."""
        data = rng.choice(self._valid)
        return mutate_bytes(rng, data, WORDS) if rng.random() < 0.9 else data

    def written(self, data: bytes) -> Path:
        """Write a file, with the suffix of a compressed one if it starts like one."""
        path = self._path / ("c0.txt.gz" if data.startswith(_PACKED) else "c0.txt")
        path.write_bytes(data)
        return path

    def close(self) -> None:
        """Remove the folder."""
        self._folder.cleanup()


class MotRoundTrip(_MotFiles):
    """Target for the round trip: rows that are read, written and read again stay the same."""

    name = "mot-text"

    def make(self, rng: Random) -> bytes:
        """Return a file."""
        data = self.file(rng)
        if rng.random() < 0.05:
            data = gzip.compress(data, 1)
            data = mutate_bytes(rng, data) if rng.random() < 0.8 else data
        return data

    def feed(self, data: bytes) -> bool:
        """Read it."""
        try:
            rows = read_rows(self.written(data))
        except ValueError as error:
            return refused(error)
        assert np.isfinite([row.box for row in rows]).all(), "infinite box"
        written = _readable(format_rows(rows))
        again = format_rows(parse_rows(written, "again")).splitlines()
        assert sorted(again) == sorted(written)
        return True


def _readable(text: str) -> list[str]:
    """Drop boxes that are too small for two decimals."""
    return [line for line in text.splitlines() if "0.00" not in line.split(",")[4:6]]


class DetectionFile(_MotFiles):
    """Target for a camera's detections, read frame by frame."""

    name = "mot-detections"

    def __init__(self) -> None:
        super().__init__()
        self._picture = np.zeros((48, 64, 3), dtype=np.uint8)

    def make(self, rng: Random) -> bytes:
        """Return a file."""
        return self.file(rng)

    def feed(self, data: bytes) -> bool:
        """Read the first frames."""
        try:
            detector = MotFileDetector(self.written(data))
        except ValueError as error:
            return refused(error)
        for frame in (0, 1, detector.last_frame):
            found = detector.detect(self._picture, frame)
            assert np.isfinite(found.boxes).all()
            assert np.isfinite(found.histograms).all()
        return True


class TrackFile(_MotFiles):
    """Target for tracks of a walk, from which cameras are calibrated."""

    name = "mot-trajectories"
    min_id = 1

    def make(self, rng: Random) -> bytes:
        """Return a file of tracks."""
        return self.file(rng)

    def feed(self, data: bytes) -> bool:
        """Read the file as a walk."""
        try:
            walks_from_tracks([self.written(data)], VideoFormat(None, None))
        except UserError as error:
            return refused(error)
        return True


TARGETS = (MotRoundTrip, DetectionFile, TrackFile)
