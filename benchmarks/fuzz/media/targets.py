"""Media with damaged packets: from cameras through the splice, in files, and as a client reads them."""

from __future__ import annotations

from benchmarks.fuzz.media.camera_packets import Files, OwnPackets
from benchmarks.fuzz.media.client_streams import ClientMp4, ClientWebm, Events
from benchmarks.fuzz.media.live_ingest import Live
from benchmarks.fuzz.media.splicing import Splice, SpliceOwn, SpliceVp8
from benchmarks.fuzz.media.stored_streams import Drawing, Kept

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
