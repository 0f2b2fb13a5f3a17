"""Server-sent events: the parser, and the event stream after an interruption."""

from __future__ import annotations

import asyncio

import pytest
from aiohttp import web
from hypothesis import given, settings
from hypothesis import strategies as st

import client
from client.sse_parser import MAX_EVENT, OverlongEventError, SentEvent, SseParser
from fakes.http.scripted_server import CAMERAS, OBJECTS, SITE, ScriptedSite, gop, send_nothing, sse_event
from fakes.timeouts import PATIENCE

FLAG = {"id": 1, "objects": [7, 9], "cameras": ["c0"], "reason": "crossing", "pulse": 80} | {
    "raised": 50,
    "margin": 0.5,
    "risk": 0.5,
    "state": "raised",
}
HASTY = client.HttpSettings(stream_retries=2, backoff_first=0.01, backoff_most=0.01)


def test_an_event_has_a_name_data_and_the_last_id() -> None:
    stream = b"\xef\xbb\xbf: hello\nid: 7\nevent: gop\ndata: {\ndata:}\n\n"
    stream += b"data: more\nretry: 3\nodd\n\nevent: empty\n\n"
    assert SseParser().feed(stream) == [SentEvent("gop", "{\n}", "7"), SentEvent("message", "more", "7")]


# One-line texts; the data of an event may not hold a line end.
texts = st.text(st.characters(exclude_characters="\r\n\0", exclude_categories=["Cs"]), max_size=12)
ends = st.sampled_from(["\n", "\r\n", "\r"])


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.tuples(texts.filter(lambda name: not name.startswith(" ")), texts)), ends, st.integers(1, 9)
)
def test_events_are_the_same_however_the_bytes_arrive(
    events: list[tuple[str, str]], end: str, step: int
) -> None:
    text = "".join(f"event: {name}{end}data: {data}{end}{end}" for name, data in events)
    stream = text.encode() + b":\n"  # the comment ends a last lone CR
    parser = SseParser()
    parsed = [event for at in range(0, len(stream), step) for event in parser.feed(stream[at : at + step])]
    assert [(event.name, event.data) for event in parsed] == [
        (name or "message", data) for name, data in events
    ]


@settings(deadline=None, max_examples=60)
@given(st.lists(st.binary(max_size=40), max_size=10))
def test_any_bytes_are_parsed_without_a_crash(pieces: list[bytes]) -> None:
    parser = SseParser()
    for piece in pieces:
        parser.feed(piece)


@pytest.mark.parametrize("piece", [b"x" * 1_000_000, b"data: " + b"x" * 1_000_000 + b"\n"])
def test_an_endless_event_is_refused_before_it_fills_memory(piece: bytes) -> None:
    parser = SseParser()
    with pytest.raises(OverlongEventError):
        feed_often(parser, piece)


def feed_often(parser: SseParser, piece: bytes) -> None:
    for _ in range(2 * MAX_EVENT // len(piece)):
        parser.feed(piece)


async def take(url: str, count: int) -> list[client.Event]:
    stream = client.events(url, HASTY)
    try:
        async with asyncio.timeout(PATIENCE):
            return [await anext(stream) for _ in range(count)]
    finally:
        await stream.aclose()  # type: ignore[attr-defined]


async def test_events_are_decoded_to_their_types(scripted_site: ScriptedSite, site_url: str) -> None:
    async def tell(response: web.StreamResponse) -> None:
        stream = sse_event("site", SITE) + sse_event("objects", OBJECTS) + sse_event("cameras", CAMERAS)
        stream += (
            sse_event("weather", {"rain": True}) + sse_event("flag", FLAG) + sse_event("gop", gop(50, "c1"))
        )
        for at in range(0, len(stream), 100):
            await response.write(stream[at : at + 100])
        await send_nothing(response)

    scripted_site.event_scripts.append(tell)
    site, objects, cameras, flag, last = await take(site_url, 5)
    assert isinstance(site, client.Site)
    assert isinstance(objects, client.Objects)
    assert isinstance(cameras, client.Cameras)
    assert isinstance(flag, client.Flag)
    assert (flag.objects, flag.pulse, flag.state) == ((7, 9), 80, "raised")
    assert isinstance(last, client.Gop)
    assert (last.first, last.choices) == (50, {1: "c1", 2: None})
    assert last.boxes["c0"][0] == (client.Box(1, 10.0, 20.0, 30.5, 80.0),)
    assert last.cuts == (client.Cut(1, "c0", "c1", 50),)


async def test_events_continue_after_an_interruption(scripted_site: ScriptedSite, site_url: str) -> None:
    async def one(response: web.StreamResponse) -> None:
        await response.write(sse_event("gop", gop(50, "c0")) + b"event: gop\ndata: {")

    async def another(response: web.StreamResponse) -> None:
        await response.write(sse_event("gop", gop(60, "c1")))
        await send_nothing(response)

    scripted_site.event_scripts.extend([one, another])
    gops = await take(site_url, 2)
    assert [event.first for event in gops if isinstance(event, client.Gop)] == [50, 60]


async def test_a_server_that_stays_away_ends_the_events(scripted_site: ScriptedSite, site_url: str) -> None:
    async def one(response: web.StreamResponse) -> None:
        await response.write(sse_event("gop", gop(50, "c0")))

    scripted_site.event_scripts.append(one)
    with pytest.raises(client.AwayError):
        await take(site_url, 2)


async def test_an_invalid_event_is_an_error(scripted_site: ScriptedSite, site_url: str) -> None:
    async def wrong(response: web.StreamResponse) -> None:
        await response.write(sse_event("gop", {"first": "now"}))

    scripted_site.event_scripts.append(wrong)
    with pytest.raises(client.ContractError, match="event gop"):
        await take(site_url, 1)
