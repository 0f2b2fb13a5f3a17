"""The containers' health checks, also over HTTPS and with a token."""

from __future__ import annotations

import asyncio
import http.server
import json
import os
import shutil
import ssl
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from camsync import PulseServer
from camsync.protocol import is_password
from fakes.paths import ROOT
from fakes.programs import needs_openssl
from server.cli.generated_config import free_port
from server.config.password_file import read_users
from server.config.tokens_file import read_tokens, secret_digest
from server.supervisor.healthcheck import main

LIVE = {"camera": "c0", "state": "live", "fps": 25.0, "message": ""}


class Service(http.server.ThreadingHTTPServer):
    """A best-view service's answers to health checks."""

    def __init__(self, secrets: Path | None = None) -> None:
        super().__init__(("127.0.0.1", 0), _Answer)
        self.cameras: list[dict[str, Any]] = [LIVE]
        self.token = "" if secrets is None else (secrets / "cameras/c0/token").read_text("ascii").strip()
        if secrets is not None:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(secrets / "public" / "https.pem", secrets / "web" / "https.key")
            self.socket = context.wrap_socket(self.socket, server_side=True)

    def handle_error(self, *_: object) -> None:
        """Suppress the error log for clients that disconnect."""


class _Answer(http.server.BaseHTTPRequestHandler):
    server: Service

    def do_GET(self) -> None:
        allowed = not self.server.token or self.headers["Authorization"] == f"Bearer {self.server.token}"
        self.send_response(200 if allowed or self.path == "/healthz" else 401)
        self.end_headers()
        self.wfile.write(json.dumps({"cameras": self.server.cameras}).encode())

    def log_message(self, *_: object) -> None:
        """Suppress the access log."""


def serving(service: Service) -> Iterator[Service]:
    running = threading.Thread(target=partial(service.serve_forever, 0.01))
    running.start()
    yield service
    service.shutdown()
    running.join()
    service.server_close()


@pytest.fixture
def http_service(monkeypatch: pytest.MonkeyPatch) -> Iterator[Service]:
    service = Service()
    monkeypatch.setenv("MYVIEW_HEALTH_URL", f"http://127.0.0.1:{service.server_port}")
    yield from serving(service)


@pytest.fixture(scope="module")
def secrets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make all files as an operator does."""
    folder = tmp_path_factory.mktemp("made") / "secrets"
    arguments = ["sh", str(ROOT / "configs" / "secrets.sh"), "cameras.example", "c0"]
    subprocess.run(
        arguments, env={**os.environ, "MYVIEW_SECRETS": str(folder)}, check=True, capture_output=True
    )
    return folder


@pytest.fixture
def https_service(secrets: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Service]:
    service = Service(secrets)
    monkeypatch.setenv("MYVIEW_HEALTH_URL", f"https://127.0.0.1:{service.server_port}/")
    monkeypatch.setenv("MYVIEW_HEALTH_CERTIFICATE", str(secrets / "public" / "https.pem"))
    monkeypatch.setenv("MYVIEW_HEALTH_TOKEN", str(secrets / "cameras" / "c0" / "token"))
    yield from serving(service)


@pytest.mark.parametrize("users", [None, {"c0": "a password"}])
async def test_the_pulse_server_is_healthy_while_it_sends_its_greeting(
    monkeypatch: pytest.MonkeyPatch, users: dict[str, str] | None
) -> None:
    async with PulseServer(25.0, users=users) as server:
        monkeypatch.setenv("MYVIEW_SYNC__PORT", str(server.port))
        assert await _run_check("sync") == 0
        assert server.refused == 0, "repeated health checks are not logged as strangers"
    monkeypatch.setenv("MYVIEW_SYNC__PORT", str(free_port()))
    assert await _run_check("sync") == 1


async def _run_check(*arguments: str) -> int:
    """Check as the container engine does, in a separate process."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "server.supervisor.healthcheck",
        *arguments,
        cwd=ROOT,
        stdout=asyncio.subprocess.DEVNULL,
    )
    return await process.wait()


def test_a_camera_is_healthy_when_its_frames_arrive(
    http_service: Service, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["camera", "c0"]) == 0
    assert main(["bestview"]) == 0
    for state in (
        {"fps": 0.0},
        {"state": "gone", "message": "its source gives no pictures"},
        {"camera": "c1"},
    ):
        http_service.cameras = [{**LIVE, **state}]
        assert main(["camera", "c0"]) == 1
        assert capsys.readouterr().out.count("\n") == 1


def test_a_camera_is_healthy_while_one_of_two_services_receives_its_frames(
    http_service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    running, dead = f"http://127.0.0.1:{http_service.server_port}", f"http://127.0.0.1:{free_port()}"
    for services in (f"{running},{dead}", f"{dead}, {running}"):
        monkeypatch.setenv("MYVIEW_HEALTH_URL", services)
        assert main(["camera", "c0"]) == 0
    assert main(["bestview"]) == 1, "its own port is that of the first one"
    monkeypatch.setenv("MYVIEW_HEALTH_URL", f"http://no-name.invalid:{http_service.server_port}")
    assert main(["bestview"]) == 0, "its name is not resolved"
    monkeypatch.setenv("MYVIEW_HEALTH_URL", f"{dead},{running}")
    http_service.cameras = [{**LIVE, "state": "gone"}]
    assert main(["camera", "c0"]) == 1


@pytest.mark.usefixtures("http_service")
def test_no_proxy_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("http_proxy", f"http://127.0.0.1:{free_port()}")
    monkeypatch.delenv("no_proxy", raising=False)
    assert main(["bestview"]) == 0


def test_an_unknown_check_is_unhealthy(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MYVIEW_HEALTH_URL", f"http://127.0.0.1:{free_port()}")
    for arguments in (["bestview"], ["camera", "c0"], ["camera"], []):
        assert main(arguments) == 1
        assert capsys.readouterr().out.count("\n") == 1


def test_an_invalid_answer_is_unhealthy(http_service: Service) -> None:
    http_service.cameras = [{"camera": "c0"}]
    assert main(["camera", "c0"]) == 1


@needs_openssl
@pytest.mark.usefixtures("https_service")
def test_https_checks_use_the_certificate_and_the_token(
    secrets: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["camera", "c0"]) == 0
    assert main(["bestview"]) == 0
    with monkeypatch.context() as patch:
        patch.setenv("MYVIEW_HEALTH_CERTIFICATE", str(secrets / "public" / "router.pem"))
        assert main(["bestview"]) == 1, "the token is not sent to a service with another certificate"
    (tmp_path / "token").write_text("wrong", encoding="ascii")
    monkeypatch.setenv("MYVIEW_HEALTH_TOKEN", str(tmp_path / "token"))
    assert main(["camera", "c0"]) == 1


@needs_openssl
def test_generated_secrets_make_a_working_site(secrets: Path) -> None:
    assert (secrets.stat().st_mode & 0o777) == 0o700, "no other user of the host may read it"
    operator, health = read_tokens(secrets / "web" / "tokens.yaml")
    assert (operator.role, operator.camera) == ("operate", None)
    assert (health.role, health.camera) == ("watch", "c0")
    token = (secrets / "cameras" / "c0" / "token").read_text("ascii").strip()
    assert health.sha256 == secret_digest(token)
    c0 = secrets / "cameras" / "c0"
    assert users(secrets / "bus") == users(c0 / "bus")
    assert users(secrets / "pulses") == users(secrets / "web" / "pulses") | users(c0 / "pulses")
    assert set(users(secrets / "pulses")) == {"bestview", "c0"}
    assert all(map(is_password, users(secrets / "pulses").values()))
    assert users(c0 / "bus") != users(c0 / "pulses"), "each client has its own"


def users(path: Path) -> dict[str, str]:
    return read_users(path, "users")


def run_secrets_script(
    folder: Path, name: str, camera: str = "c0", **environment: str
) -> subprocess.CompletedProcess[str]:
    script = ["/bin/sh", str(ROOT / "configs" / "secrets.sh"), name, camera]
    surroundings = {**os.environ, "MYVIEW_SECRETS": str(folder), **environment}
    return subprocess.run(script, env=surroundings, capture_output=True, text=True, check=False)


def test_without_openssl_no_secrets_are_generated(tmp_path: Path) -> None:
    result = run_secrets_script(tmp_path / "secrets", "cameras.example", PATH=str(tmp_path))
    assert (result.returncode, result.stderr) == (1, "secrets.sh: needs openssl, which is not there\n")
    assert not (tmp_path / "secrets").exists()


@needs_openssl
@pytest.mark.parametrize("camera", ["c 0", "../x", "bestview", "bestview-1", "a: b", ""])
def test_an_invalid_camera_name_is_refused_before_anything_is_generated(tmp_path: Path, camera: str) -> None:
    result = run_secrets_script(tmp_path / "secrets", "cameras.example", camera)
    assert result.returncode == 2
    assert "cannot be a camera's name" in result.stderr
    assert not (tmp_path / "secrets").exists()


@needs_openssl
def test_a_host_name_too_long_for_a_certificate_is_refused(tmp_path: Path) -> None:
    result = run_secrets_script(tmp_path, f"{'a' * 63}.example")
    assert result.returncode == 1
    assert "too long" in result.stderr
    assert run_secrets_script(tmp_path, "cameras.example").returncode == 0
    assert not [path.name for path in tmp_path.iterdir() if path.name in {"log", "names", "request"}]


@needs_openssl
@pytest.mark.parametrize(
    ("name", "also"),
    [
        ("cameras.example", "DNS:cameras.example"),
        ("10.0.0.5", "IP Address:10.0.0.5"),
        ("2001:db8::5", "IP Address:2001:DB8:0:0:0:0:0:5"),
    ],
)
def test_a_certificate_is_for_the_name_or_the_address(tmp_path: Path, name: str, also: str) -> None:
    assert run_secrets_script(tmp_path, name).returncode == 0
    arguments = [
        "openssl",
        "x509",
        "-in",
        str(tmp_path / "public" / "https.pem"),
        "-noout",
        "-ext",
        "subjectAltName",
    ]
    output = subprocess.run(arguments, capture_output=True, text=True, check=True).stdout
    assert output.splitlines()[1:] == [f"    {also}"]


@needs_openssl
def test_a_camera_is_added_to_a_secure_site_that_stays_as_it_is(secrets: Path, tmp_path: Path) -> None:
    folder = tmp_path / "secrets"
    shutil.copytree(secrets, folder)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    arguments = ["sh", str(ROOT / "configs" / "secrets.sh"), "cameras.example", "c0", "yard"]
    subprocess.run(
        arguments, env={**os.environ, "MYVIEW_SECRETS": str(folder)}, check=True, capture_output=True
    )
    assert all(path.read_bytes().startswith(content) for path, content in before.items())
    new = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    new -= {str(path.relative_to(folder)) for path in before}
    assert new == {f"cameras/yard/{name}" for name in ("bus", "pulses", "token")}


@needs_openssl
def test_a_site_without_pulse_passwords_gets_them(secrets: Path, tmp_path: Path) -> None:
    folder = tmp_path / "secrets"
    shutil.copytree(secrets, folder)
    for name in ("pulses", "web/pulses", "cameras/c0/pulses"):
        (folder / name).unlink()
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert run_secrets_script(folder, "cameras.example").returncode == 0
    assert all(path.read_bytes() == content for path, content in before.items())
    assert set(users(folder / "pulses")) == {"bestview", "c0"}
