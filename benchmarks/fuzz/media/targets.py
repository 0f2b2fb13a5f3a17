"""Fuzzing of media: packets of cameras, splicing, files, and streams to clients."""

from __future__ import annotations

from benchmarks.fuzz.media.camera_packets import PassthroughPackets, RecordingFile
from benchmarks.fuzz.media.client_streams import ClientEvents, ClientMp4, ClientWebm
from benchmarks.fuzz.media.live_ingest import LiveIngest
from benchmarks.fuzz.media.splicing import Splice, SpliceH265, SplicePassthrough, SpliceVp8
from benchmarks.fuzz.media.stored_streams import RenderedStreams, StoredMedia

TARGETS = (
    Splice,
    SplicePassthrough,
    SpliceH265,
    SpliceVp8,
    ClientMp4,
    ClientWebm,
    ClientEvents,
    PassthroughPackets,
    StoredMedia,
    RenderedStreams,
    RecordingFile,
    LiveIngest,
)
