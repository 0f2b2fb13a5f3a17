"""A file that beeps at known times, and detection of the beeps in a stream."""

from __future__ import annotations

import io
import wave
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

RATE = 44_100
"""Not the site's sample rate, so that the audio must be resampled."""
EVERY_S = 1.0
_BEEP_S = 0.08


def write_beeps(path: Path) -> Path:
    """Write a file of two seconds with a beep in each."""
    time = np.arange(2 * RATE) / RATE
    samples = 0.5 * np.sin(2 * np.pi * 1000 * time) * (time % EVERY_S < _BEEP_S)
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE)
        file.writeframes((samples * 32767).astype("<i2").tobytes())
    return path


def sample_and_beep_times(path: Path) -> tuple[NDArray[np.float64], list[float]]:
    """Return the media times of all audio samples of a stream, and of the starts of beeps, seconds."""
    data = path.read_bytes()
    with av.open(io.BytesIO(data[: data.rfind(b"moof") - 4])) as container:
        frames = list(container.decode(audio=0))
    times = np.concatenate(
        [float(frame.time or 0) + np.arange(frame.samples) / frame.sample_rate for frame in frames]
    )
    loud = times[np.abs(np.concatenate([frame.to_ndarray()[0] for frame in frames])) > 0.1]
    begins = [float(time) for before, time in pairwise([times[0], *loud]) if time - before > EVERY_S / 2]
    return times, begins
