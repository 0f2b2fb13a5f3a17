"""Fragmented MP4 muxer (ISO/IEC 14496-12 and -15): the init segment, and independent fragments of frames.

A muxer library would hold a fragment back until the next packet, and mux every stream again. Here a fragment
is built once per camera and frame, and every stream is a list of references to such fragments.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

from server.media.audio.audio_format import AudioFormat
from server.media.containers.mp4_audio import AUDIO_TRACK, audio_track
from server.media.containers.mp4_boxes import box, full_box, moof_mdat, movie_header, track, track_defaults
from server.media.parameter_sets import ParameterSets
from server.media.rendering_messages import TIMESCALE

_TRACK = 1
_SYNC_SAMPLE = 0x02000000
"""sample_depends_on = 2: an I picture (8.8.3.1)."""
_OTHER_SAMPLE = 0x01010000
"""sample_depends_on = 1, sample_is_non_sync_sample."""
_BRANDS = {"avcC": b"avc1", "hvcC": b"hvc1"}
_TFDT_AT = 8 + 16 + 8 + 16 + 12
"""The offset of a fragment's decode time: behind the headers of moof, mfhd, traf, tfhd and tfdt."""


@dataclass(frozen=True, slots=True)
class FragmentSample:
    """One frame ready for a fragment."""

    data: bytes
    """Length-prefixed NAL units."""
    key: bool
    duration: int = 1
    """The number of pulses it is shown for."""


def ticks(pulse: int, fps: float) -> int:
    """Return the presentation time of a pulse in ticks: pulse / fps seconds, rounded."""
    return round(pulse * TIMESCALE / fps)


def init_segment(
    parameters: ParameterSets, width: int, height: int, audio: AudioFormat | None = None
) -> bytes:
    """Return the init segment, ``ftyp`` and ``moov``, of streams with and without audio."""
    last = _TRACK if audio is None else AUDIO_TRACK
    return box(
        "ftyp",
        b"iso5" + struct.pack(">I", 512) + b"iso5iso6" + _BRANDS[parameters.configuration_kind] + b"mp41",
    ) + box(
        "moov",
        movie_header(last),
        track(
            _TRACK,
            TIMESCALE,
            b"vide",
            full_box("vmhd", 0, 1, bytes(8)),
            _entry(parameters, width, height),
            size=(width, height),
        ),
        b"" if audio is None else audio_track(audio),
        box("mvex", *(track_defaults(number + 1) for number in range(last))),
    )


def fragment(samples: Sequence[FragmentSample], first: int, fps: float) -> bytes:
    """Return ``moof`` and ``mdat`` of consecutive frames, the first of which is shown at pulse ``first``."""
    pulses = accumulate((sample.duration for sample in samples), initial=first)
    return _fragment(samples, first, [ticks(pulse, fps) for pulse in pulses])


def still_fragment(samples: Sequence[FragmentSample], first: int, until: int, fps: float) -> bytes:
    """Return a fragment that shows its last frame in ``first … until - 1``; the others last a tick each."""
    begin = ticks(first, fps)
    return _fragment(samples, first, [*(begin + index for index in range(len(samples))), ticks(until, fps)])


def _fragment(samples: Sequence[FragmentSample], first: int, edges: Sequence[int]) -> bytes:
    """Return the fragment of samples, each shown from its edge (ticks) to the next."""
    entries = b"".join(
        struct.pack(
            ">3I",
            edges[number + 1] - edges[number],
            len(sample.data),
            _SYNC_SAMPLE if sample.key else _OTHER_SAMPLE,
        )
        for number, sample in enumerate(samples)
    )
    track_head = full_box("tfhd", 0, 0x020000, struct.pack(">I", _TRACK))
    return moof_mdat(first, track_head, edges[0], 0x000701, entries, [sample.data for sample in samples])


def _entry(parameters: ParameterSets, width: int, height: int) -> bytes:
    return box(
        parameters.entry,
        bytes(6) + struct.pack(">H", 1) + bytes(16) + struct.pack(">2H", width, height)
        + struct.pack(">2I", 0x480000, 0x480000) + bytes(4) + struct.pack(">H", 1) + bytes(32)
        + struct.pack(">Hh", 24, -1),
        box(parameters.configuration_kind, parameters.configuration),
    )  # fmt: skip


def shift_fragment(fragment: bytes, by_ticks: int) -> bytes:
    """Return a fragment of :func:`fragment` moved in time."""
    (time,) = struct.unpack_from(">Q", fragment, _TFDT_AT)
    return fragment[:_TFDT_AT] + struct.pack(">Q", time + by_ticks) + fragment[_TFDT_AT + 8 :]


def sample_of(fragment: bytes) -> bytes:
    """Return the sample of a single-sample fragment of :func:`fragment`."""
    (moof_bytes,) = struct.unpack_from(">I", fragment)
    return fragment[moof_bytes + 8 :]
