"""A recording continues at another server of the site: one that disconnects, is silent or refuses is left."""

from __future__ import annotations

from pathlib import Path

import pytest
from aiohttp import web

import client
from client.http import HttpSettings
from fakes.http.scripted_server import SITE, ScriptedSite, Serve, StreamScript, fragment, header, send_nothing
from server.cli.generated_config import free_port


def plays(*pieces: bytes, stays: bool) -> StreamScript:
    async def play(response: web.StreamResponse) -> None:
        await response.write(b"".join(pieces))
        if stays:
            await send_nothing(response)

    return play


def frames(first: int, count: int) -> bytes:
    return b"".join(fragment(pulse) for pulse in range(first, first + count))


@pytest.mark.parametrize("stays", [False, True], ids=["disconnects", "is silent"])
async def test_a_recording_goes_on_at_the_server_that_the_site_names(
    serve: Serve, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, stays: bool
) -> None:
    second = ScriptedSite([plays(header(), frames(8, 20), stays=True)])
    url = await serve(second)
    monkeypatch.setitem(SITE, "others", [url])
    first = await serve(ScriptedSite([plays(header(), frames(0, 10), stays=stays)]))
    result = await client.record(first, 1, tmp_path / "one.mp4", seconds=0.8)
    assert (tmp_path / "one.mp4").read_bytes() == header() + frames(0, 20)
    assert (result.complete, result.reconnections) == (True, 1)


async def test_the_first_server_may_be_down(serve: Serve, tmp_path: Path) -> None:
    second = await serve(ScriptedSite([plays(header(), frames(0, 30), stays=True)]))
    first = f"http://127.0.0.1:{free_port()}/"
    result = await client.record(first, 1, tmp_path / "one.mp4", 0.4, HttpSettings(others=(second,)))
    assert result.complete


def test_a_token_is_not_sent_without_tls_where_the_first_server_has_it() -> None:
    others = ("http://two/", "https://three/", "nowhere://", "https://one/")
    settings = HttpSettings().failing_over("https://one/", others, 0.5)
    assert settings.others == ("https://three/",)
    assert settings.read_timeout == pytest.approx(1.25)
    alone = HttpSettings()
    assert alone.failing_over("http://one/", (), 0.5) is alone
