"""Media with damaged packets: from cameras through the splice, in files, and as a client reads them."""

from __future__ import annotations

from benchmarks.fuzz.media_cameras import Files, OwnPackets
from benchmarks.fuzz.media_client import ClientMp4, ClientWebm, Events
from benchmarks.fuzz.media_kept import Drawing, Kept
from benchmarks.fuzz.media_live import Live
from benchmarks.fuzz.media_splice import Splice, SpliceOwn, SpliceVp8

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
    Live,
)
