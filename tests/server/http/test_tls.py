"""HTTPS: certificates are reloaded without a restart; invalid ones are ignored."""

from __future__ import annotations

import asyncio
import logging
import os
import ssl
import subprocess
import sys
from contextlib import aclosing
from pathlib import Path

import aiohttp
import pytest
from pydantic import ValidationError

from fakes.http.certificates import make_certificate
from fakes.http.tokens import token_entry, token_of, write_tokens
from fakes.programs import needs_openssl
from fakes.service.fed_site import A, B, serve_site
from fakes.service.scripted_cameras import CAMERAS, SMALL
from server.config.loader import build_config
from server.config.sections import TlsSettings
from server.http.access.csrf import CSRF_HEADER
from server.http.tls import Certificate
from server.system.errors import UserError

pytestmark = needs_openssl


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> tuple[TlsSettings, TlsSettings]:
    folder = tmp_path_factory.mktemp("certificates")
    return make_certificate(folder / "first", "first"), make_certificate(folder / "second", "second")


@pytest.fixture
def tls(certificates: tuple[TlsSettings, TlsSettings], tmp_path: Path) -> TlsSettings:
    """Return a certificate in files that the test may change."""
    return copy_certificate(
        certificates[0], TlsSettings(certificate=tmp_path / "c.pem", key=tmp_path / "k.pem")
    )


def copy_certificate(source: TlsSettings, to: TlsSettings) -> TlsSettings:
    for one, other in ((source.certificate, to.certificate), (source.key, to.key)):
        assert one is not None
        assert other is not None
        other.write_bytes(one.read_bytes())
    return to


def client_context(tls: TlsSettings) -> ssl.SSLContext:
    return ssl.create_default_context(cafile=str(tls.certificate))


async def test_https_is_answered_and_plain_http_is_not(tls: TlsSettings, tmp_path: Path) -> None:
    tokens = write_tokens(tmp_path / "tokens.yaml", token_entry("desk"))
    settings = {"http": {"tls": tls.model_dump()}, "access": {"tokens": str(tokens)}}
    async with aclosing(serve_site(**settings)) as sites, aiohttp.ClientSession() as session:
        port = (await anext(sites)).port
        url = f"https://127.0.0.1:{port}"
        async with session.get(f"{url}/healthz", ssl=client_context(tls)) as answer:
            assert answer.status == 200
        body = {"token": token_of("desk")}
        async with session.post(
            f"{url}/api/session", json=body, headers={CSRF_HEADER: "1"}, ssl=client_context(tls)
        ) as answer:
            [cookie] = answer.cookies.values()
        assert cookie["secure"]
        with pytest.raises(aiohttp.ClientConnectorCertificateError):
            await session.get(f"{url}/healthz")
        with pytest.raises(aiohttp.ClientError):
            await session.get(f"http://127.0.0.1:{port}/healthz")


async def test_watch_trusts_the_authority_of_the_environment_and_sends_its_token(
    tls: TlsSettings, tmp_path: Path
) -> None:
    tokens = write_tokens(tmp_path / "tokens.yaml", token_entry("family"))
    settings = {"http": {"tls": tls.model_dump()}, "access": {"tokens": str(tokens)}}
    async with aclosing(serve_site(**settings)) as sites:
        served = await anext(sites)
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(3):
            served.service.feed(epoch, {A: {1: SMALL, 2: SMALL}, B: {}})
        trusted = {**os.environ, "SSL_CERT_FILE": str(tls.certificate)}
        for environment, text in (
            ({**trusted, "MYVIEW_TOKEN": token_of("family")}, "1       yes"),
            (trusted, "myview: watch: watching needs a token"),
        ):
            process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", "server.cli.main", "watch", f"https://127.0.0.1:{served.port}"),
                env=environment,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            )
            out, _ = await process.communicate()
            assert text in out.decode()
            assert (process.returncode == 0) == ("yes" in text)


async def is_proven(port: int, trusted: TlsSettings) -> bool:
    """Return whether a new connection is proven by a certificate."""
    try:
        _, writer = await asyncio.open_connection("127.0.0.1", port, ssl=client_context(trusted))
    except ssl.SSLCertVerificationError:
        return False
    writer.close()
    return True


async def test_a_renewed_certificate_is_used_for_new_connections(
    certificates: tuple[TlsSettings, TlsSettings], tls: TlsSettings, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "server.http.tls")
    certificate = Certificate.of(tls)
    assert certificate is not None
    server = await asyncio.start_server(
        lambda _, writer: writer.close(), "127.0.0.1", 0, ssl=certificate.context
    )
    port = server.sockets[0].getsockname()[1]
    assert await is_proven(port, certificates[0])
    assert tls.key is not None
    assert certificates[1].key is not None
    tls.key.write_bytes(certificates[1].key.read_bytes())
    certificate.reload_if_changed()
    assert "stays in force" in caplog.messages[-1]
    assert "\n" not in caplog.messages[-1]
    assert await is_proven(port, certificates[0]), "half of a pair is ignored"
    copy_certificate(certificates[1], tls)
    certificate.reload_if_changed()
    assert await is_proven(port, certificates[1])
    assert not await is_proven(port, certificates[0])
    count = len(caplog.messages)
    certificate.reload_if_changed()
    assert len(caplog.messages) == count
    server.close()
    await server.wait_closed()


def test_an_invalid_certificate_is_reported_in_one_line(
    certificates: tuple[TlsSettings, TlsSettings], tmp_path: Path
) -> None:
    none = TlsSettings(certificate=tmp_path / "none.pem", key=certificates[0].key)
    bad = tmp_path / "bad.pem"
    bad.write_text("no certificate", encoding="utf-8")
    for settings in (
        none,
        TlsSettings(certificate=bad, key=certificates[0].key),
        TlsSettings(certificate=certificates[0].certificate, key=bad),
        TlsSettings(certificate=certificates[0].certificate, key=certificates[1].key),
        TlsSettings(certificate=tmp_path, key=certificates[0].key),
    ):
        with pytest.raises(UserError) as raised:
            Certificate.of(settings)
        assert str(raised.value).startswith("http.tls")
        assert "\n" not in str(raised.value)


def test_a_key_with_a_password_is_refused_without_a_prompt(
    certificates: tuple[TlsSettings, TlsSettings], tmp_path: Path
) -> None:
    locked = tmp_path / "locked.pem"
    command = [
        "openssl",
        "ec",
        "-in",
        str(certificates[0].key),
        "-aes128",
        "-passout",
        "pass:hush",
        "-out",
        str(locked),
    ]
    subprocess.run(command, check=True, capture_output=True)
    with pytest.raises(UserError, match=r"http\.tls: .*: the key has a password; save it without one"):
        Certificate.of(TlsSettings(certificate=certificates[0].certificate, key=locked))


def test_one_file_without_the_other_is_refused() -> None:
    with pytest.raises(ValidationError, match="HTTPS needs both files"):
        TlsSettings(certificate=Path("a.pem"))


def test_certificate_paths_are_relative_to_the_configuration() -> None:
    content = {
        "cameras": [{"id": "c0", "source": "scene:room"}],
        "http": {"tls": {"certificate": "a.pem", "key": "b.pem"}},
        "access": {"tokens": "tokens.yaml"},
    }
    config = build_config(content, where="site.yaml", folder=Path("/sites"))
    assert config.http.tls == TlsSettings(certificate=Path("/sites/a.pem"), key=Path("/sites/b.pem"))
    assert config.access.tokens == Path("/sites/tokens.yaml")
