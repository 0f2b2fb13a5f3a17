"""HLS of the past: playlists over what is kept, of segments at the addresses that they had when new."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import partial

from aiohttp import web

from server.view.past.hearing import Hearing
from server.view.past.kept import kept_from
from server.view.past.moment import MomentError
from server.view.past.play import Source, sounds
from server.view.past.rewound import Rewound
from server.view.past.stream import Wish
from server.view.reel import Reel, Segment
from server.view.service import BestViewService
from server.web.api import not_now, problem
from server.web.hls_playlist import Listed, master, playlist, playlist_answer
from server.web.keys import SERVICE
from server.web.past import new_timeline, nothing_kept, wish_of

_PULSE = re.compile("p[0-9]+")


@dataclass(frozen=True, slots=True)
class Stream:
    """A stream as HLS has it: what is new, and what is past. ``reel`` is None where nothing is new."""

    what: str
    reel: Reel | None
    source: Source

    @property
    def exists(self) -> bool:
        """Whether there is or was such a stream."""
        return self.reel is not None or kept_from(self.source, 0) is not None


def playlist_of_the_past(request: web.Request, stream: Stream) -> web.Response:
    """List the segments from a moment on; where that is not named by its pulse, name the playlist that does.

    A playlist is fetched again and again, and must go on where it began: so its address must not say how long
    ago that was.
    """
    service = request.app[SERVICE]
    try:
        wish = wish_of(request, service, stream.source.end)
    except MomentError as error:
        return problem(400, str(error))
    missing = nothing_kept(stream.source, wish, stream.what)
    if missing is not None:
        return missing
    moments = (request.query[name] for name in ("from", "to") if name in request.query)
    if not all(_PULSE.fullmatch(it) for it in moments):
        return _master(service, stream, wish)
    rewound = _rewound(service, stream)
    listed = [Listed(it.number, it.first, it.until) for it in rewound.entries(wish.start, wish.end)]
    if not listed:
        return not_now("the first segment is not whole yet")
    over = _is_over(stream) or (wish.end is not None and listed[-1].until >= wish.end)
    stays = "VOD" if over else "EVENT"
    extra = [] if service.past.store is None else [f"#EXT-X-PLAYLIST-TYPE:{stays}"]
    extra += [] if over else ["#EXT-X-START:TIME-OFFSET=0"]
    return playlist_answer(playlist(listed, service.splicer.plan, service.pulse0, extra, ended=over))


async def segment_of_the_past(request: web.Request, stream: Stream, number: int) -> Segment | None:
    """Give a segment that is not in the newest playlist any more; None where it is not kept."""
    return await _rewound(request.app[SERVICE], stream).segment(number)


def _rewound(service: BestViewService, stream: Stream) -> Rewound:
    past = service.past
    hearing = partial(_hearing, service)
    timeline = partial(new_timeline, service)
    plan, gop, decided = service.splicer.plan, service.config.encode.gop, past.recent.end
    over = _is_over(stream)
    return Rewound(stream.source, plan, timeline, hearing, gop=gop, decided=decided, over=over)


def _hearing(service: BestViewService) -> Hearing | None:
    past, sound = service.past, service.past.sound
    return None if sound is None else Hearing(sound, lambda: sounds(past))


def _is_over(stream: Stream) -> bool:
    return stream.reel is None or stream.reel.ended


def _master(service: BestViewService, stream: Stream, wish: Wish) -> web.Response:
    parameters, site, sound = service.agreement.parameters, service.config.site, service.config.sound
    if parameters is None:
        return not_now("no camera has delivered a picture yet")
    codecs = parameters.codec if sound.format is None else f"{parameters.codec},{sound.format.codec}"
    bits = _peak(stream.source, site.fps) + (0 if sound.format is None else 1000 * sound.kbps)
    address = f"index.m3u8?from=p{wish.start}" + ("" if wish.end is None else f"&to=p{wish.end}")
    return playlist_answer(master(address, round(bits), codecs, site))


def _peak(source: Source, fps: float) -> float:
    """Give the most bits a second that pictures took, by whole files of the recording and GOPs in memory."""
    rates = [8 * it.length / it.frames for one in source.recorded for it in one.tape.all]
    gop = source.recall(0)
    while gop is not None:
        rates.append(8 * sum(map(len, gop.fragments)) / len(gop.fragments))
        gop = source.recall(gop.end)
    return fps * max(rates, default=0.0)
