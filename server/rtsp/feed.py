"""Feeds: each takes one stream from the service and pushes its samples into the pipeline of an RTSP media.

A feed goes on through everything that passes: a restart of the service, a camera's death, other parameter
sets, somebody's walk into another area or site, and a client's pause, after which it is live. It ends when
the service refuses the stream for good (a revoked token), when the stream is gone for a minute (a forgotten
person), or when its client leaves.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Iterator

import gi

for _name in ("Gst", "GstApp"):
    gi.require_version(_name, "1.0")
from gi.repository import Gst, GstApp  # noqa: E402

from server.rtsp.mp4_reader import (  # noqa: E402
    Head,
    Mp4Error,
    Mp4Reader,
    Sample,
    Track,
    with_parameter_sets,
)
from server.rtsp.presentation_clock import PresentationClock  # noqa: E402
from server.rtsp.request import StreamAddress  # noqa: E402
from server.rtsp.service_stream import (  # noqa: E402
    Service,
    ServiceAwayError,
    ServiceStream,
    StreamRefusedError,
)

log = logging.getLogger(__name__)

_ABANDON_S = 60.0
"""How long the service may be away, or not know the stream, until its clients are sent away."""
_RETRY_S = 0.5
_REFUSED_FOR_GOOD = {401, 403}
_QUEUE_BYTES = 4_000_000
"""What waits for one pipeline at most; then the oldest is dropped."""
_SLACK_S = 1.0
_LEAST_STEP_S = 0.001
"""Between two samples of a track: times must ascend."""


class Feed:
    """One stream of the service, for the one media of one client.

    Attributes:
        address: the stream.
        tracks: its tracks, when it was opened.
    """

    def __init__(self, service: Service, address: StreamAddress, on_end: Callable[[Feed], None]) -> None:
        """Open the stream and read its head.

        Raises:
            StreamRefusedError: the service refuses it.
            ServiceAwayError: it does not answer, or sends nothing.
        """
        self._service, self.address, self._on_end = service, address, on_end
        self._stream = service.open(address.path, address.token)
        self._parts = _parts(self._stream)
        self.tracks = self._first_head().tracks
        self._sources: dict[str, GstApp.AppSrc] = {}
        """By codec, once a media has taken the feed."""
        self._last_due_s: dict[str, float] = {}
        self._clock = self._new_clock()
        self._is_paused = self._is_resuming = False
        self._stopped = threading.Event()

    def connect(self, media: Gst.Element) -> None:
        """Push into the sources of a media's element from now on; once."""
        for track in self.tracks:
            source = media.get_by_name(source_name(track))
            source.set_property("caps", caps_of(track))
            source.set_property("max-bytes", _QUEUE_BYTES)
            self._sources[track.codec] = source
        threading.Thread(target=self._run, args=(media,), name=self.address.path, daemon=True).start()

    @property
    def is_connected(self) -> bool:
        """Whether a media has taken it."""
        return bool(self._sources)

    @property
    def has_ended(self) -> bool:
        """Whether it pushes nothing more."""
        return self._stopped.is_set()

    def pause(self) -> None:
        """Drop what comes from now on: later it would be late, and come all at once."""
        self._is_paused = True

    def resume(self) -> None:
        """Go on with the next keyframe, as the media's time does."""
        if self._is_paused:
            self._is_paused, self._is_resuming = False, True

    def stop(self) -> None:
        """End it, from any thread."""
        self._stopped.set()
        self._stream.close()

    def _new_clock(self) -> PresentationClock:
        return PresentationClock(_SLACK_S if self.address.is_paced else 0.0)

    def _first_head(self) -> Head:
        with contextlib.suppress(Mp4Error):
            for part in self._parts:
                if isinstance(part, Head):
                    return part
        self._stream.close()
        raise ServiceAwayError("the service's stream has no head")

    def _run(self, media: Gst.Element) -> None:
        try:
            self._push_all(media)
        finally:
            self._stopped.set()
            self._stream.close()
            for source in self._sources.values():
                source.end_of_stream()
            self._on_end(self)

    def _push_all(self, media: Gst.Element) -> None:
        while not self._stopped.is_set():
            try:
                for part in self._parts:
                    self._push(part, media)
            except (ServiceAwayError, Mp4Error) as error:
                log.debug("%s: %s", self.address.path, error)
            if self._stopped.is_set() or not self._reopen():
                return

    def _reopen(self) -> bool:
        """Wait for the service; return whether the stream is open again."""
        until, reason = time.monotonic() + _ABANDON_S, "the service has ended the stream"
        while not self._stopped.wait(_RETRY_S):
            try:
                self._stream = self._service.open(self.address.path, self.address.token)
            except StreamRefusedError as error:
                reason = str(error)
                if error.status in _REFUSED_FOR_GOOD:
                    break
            except ServiceAwayError as error:
                reason = str(error)
            else:
                if self._stopped.is_set():
                    self._stream.close()
                self._parts = _parts(self._stream)
                return True
            if time.monotonic() > until:
                break
        if not self._stopped.is_set():
            log.info("%s ends: %s", self.address.path, reason)
        return False

    def _push(self, part: Head | Sample, media: Gst.Element) -> None:
        if isinstance(part, Head):
            for track in part.tracks:
                if (source := self._sources.get(track.codec)) is not None:
                    source.set_property("caps", caps_of(track))
            return
        source = self._sources.get(part.track.codec)
        if source is None:
            return
        is_keyframe = part.track.is_video and part.is_key
        if self._is_paused or (self._is_resuming and not is_keyframe):
            return
        running_s = _running_s(media)
        if self._is_resuming:
            self._is_resuming, self._clock = False, self._new_clock()
            running_s = max(running_s, *self._last_due_s.values())  # after what waited as it was paused
        due_s = self._clock.due(part.time_s, running_s, is_key=is_keyframe)
        due_s = max(due_s, self._last_due_s.get(part.track.codec, 0.0) + _LEAST_STEP_S)
        self._last_due_s[part.track.codec] = due_s
        data = with_parameter_sets(part.data, part.track) if is_keyframe else part.data
        buffer = Gst.Buffer.new_wrapped(data)
        buffer.pts = buffer.dts = int(due_s * Gst.SECOND)
        buffer.duration = int(part.duration_s * Gst.SECOND)
        if not part.is_key:
            buffer.set_flags(Gst.BufferFlags.DELTA_UNIT)
        source.push_buffer(buffer)


def _running_s(media: Gst.Element) -> float:
    """Return a media's running time; 0 before it plays.

    Not by `get_current_running_time`: between the clock and its base time, which a media gets one after the
    other, that is the clock's own time, hours ahead; samples that are due then would hold back all others.
    """
    base, clock = media.get_base_time(), media.get_clock()
    return float(clock.get_time() - base) / Gst.SECOND if base and clock is not None else 0.0


def _parts(stream: ServiceStream) -> Iterator[Head | Sample]:
    reader = Mp4Reader()
    for block in stream.blocks():
        yield from reader.feed(block)


def source_name(track: Track) -> str:
    """Return the name of the element in a media that a track is pushed into."""
    return f"source_{track.codec}"


def caps_of(track: Track) -> Gst.Caps:
    """Return the caps of a track's samples."""
    match track.codec:
        case "h264":
            text = "video/x-h264,stream-format=avc,alignment=au"
        case "h265":
            text = "video/x-h265,stream-format=hvc1,alignment=au"  # the payloader does not know hev1
        case "aac":
            text = f"audio/mpeg,mpegversion=4,stream-format=raw,rate={track.rate},channels={track.channels}"
        case _:
            text = f"audio/x-opus,rate={track.rate},channels={track.channels},channel-mapping-family=0"
    caps = Gst.Caps.from_string(text)
    if track.configuration:
        caps.set_value("codec_data", Gst.Buffer.new_wrapped(track.configuration))
    return caps
