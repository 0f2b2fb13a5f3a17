"""docker-compose.secure.yml on a real engine: tokens give access by HTTPS, and strangers have none."""

from __future__ import annotations

import asyncio
import os
import re
import shutil
import ssl
import subprocess
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import aiohttp
import av
import pytest

from benchmarks.common.environment import ROOT
from benchmarks.faults.site.compose_site import PLAIN, ComposeSite, missing_requirement, run_compose_site

pytestmark = [pytest.mark.live, pytest.mark.slow, pytest.mark.timeout(1200)]

VISIBLE_S = 180
PUBLISH = """
import json, pathlib, sys, time, zenoh
config = zenoh.Config()
settings = {"mode": "client", "connect/endpoints": [sys.argv[1]], "connect/timeout_ms": 5000,
        "scouting/multicast/enabled": False}
if len(sys.argv) > 3:
    settings["transport/link/tls/root_ca_certificate"] = sys.argv[3]
if len(sys.argv) > 4:
    settings["transport/auth/usrpwd/user"] = sys.argv[4]
    settings["transport/auth/usrpwd/password"] = sys.argv[5]
for key, value in settings.items():
    config.insert_json5(key, json.dumps(value))
try:
    with zenoh.open(config) as bus:
        for _ in range(30):
            bus.put(sys.argv[2], b"{}")
            time.sleep(0.1)
    print("published")
except zenoh.ZError as error:
    print("refused", error)
"""
"""Publishes malformed messages under a key of the bus; receivers count them as bad messages."""
STATUS = "myview/demo/camera/c1/status"
BUS = "tls/bestview:7447"


@dataclass(frozen=True, slots=True)
class Secure:
    """A secure site, with its secrets, an operator token and its address."""

    site: ComposeSite
    secrets: Path
    token: str
    url: str

    def run_stranger(self, *arguments: str, network: str) -> str:
        """Run a container of the image without any secrets of the site."""
        image = self.site.environment["MYVIEW_IMAGE"]
        mounted = f"{self.secrets / 'public'}:/run/public:ro"
        command = (
            "--volume",
            mounted,
            "--network",
            network,
            "--entrypoint",
            "python",
            image,
            "-c",
            PUBLISH,
            *arguments,
        )
        return self.site.run("docker", "run", "--rm", *command, check=False)


@pytest.fixture(scope="module")
def secure(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Secure]:
    missing = missing_requirement() or ("needs openssl" if shutil.which("openssl") is None else None)
    if missing is not None:
        pytest.skip(missing)
    secrets = tmp_path_factory.mktemp("made") / "secrets"
    made = subprocess.run(
        ["sh", str(ROOT / "configs" / "secrets.sh"), "localhost", "c0", "c1", "c2"],
        env={**os.environ, "MYVIEW_SECRETS": str(secrets)},
        capture_output=True,
        text=True,
        check=True,
    )
    token = re.search(r": (\S+)$", made.stdout.strip())
    assert token
    files = (*PLAIN, ROOT / "docker-compose.secure.yml")
    with run_compose_site(files, MYVIEW_CONFIG="demo.yaml", MYVIEW_SECRETS=str(secrets)) as site:
        port = site.address().rpartition(":")[2]
        yield Secure(site, secrets, token[1], f"https://localhost:{port}")


@pytest.fixture
async def viewer(secure: Secure) -> AsyncIterator[aiohttp.ClientSession]:
    """Return a session with a token that trusts the site's certificate authority."""
    trust = ssl.create_default_context(cafile=str(secure.secrets / "public" / "authority.pem"))
    headers = {"Authorization": f"Bearer {secure.token}"}
    connector = aiohttp.TCPConnector(ssl=trust)
    async with aiohttp.ClientSession(secure.url, headers=headers, connector=connector) as session:
        yield session


async def _json(viewer: aiohttp.ClientSession, path: str) -> Any:
    async with viewer.get(path) as answer:
        assert answer.status == 200
        return await answer.json()


async def _visible_person(viewer: aiohttp.ClientSession) -> int:
    async with asyncio.timeout(VISIBLE_S):
        while True:
            for shown_object in (await _json(viewer, "/api/objects"))["objects"]:
                if shown_object["visible"]:
                    return int(shown_object["object"])
            await asyncio.sleep(0.5)


async def _bad_messages(viewer: aiohttp.ClientSession) -> float:
    async with viewer.get("/metrics") as answer:
        text = await answer.text()
    found = re.findall(r"^myview_camera_bad_messages_total\{.*\} (\S+)$", text, re.MULTILINE)
    assert found
    return sum(map(float, found))


def test_all_are_healthy_by_https_and_with_tokens(secure: Secure) -> None:
    containers = secure.site.containers()
    assert {container["State"]["Health"]["Status"] for container in containers.values()} == {"healthy"}


def test_each_container_has_only_its_secrets_and_none_in_a_variable(secure: Secure) -> None:
    for camera in ("c0", "c1", "c2"):
        mounted = secure.site.compose("exec", "-T", camera, "ls", "/run/secrets").split()
        assert sorted(mounted) == ["bus", "pulses", "token"]
        for secret in ("bus", "pulses"):
            content = secure.site.compose("exec", "-T", camera, "cat", f"/run/secrets/{secret}")
            assert content == (secure.secrets / "cameras" / camera / secret).read_text("ascii").strip()
    hidden = [
        path.read_text("ascii").strip()
        for path in secure.secrets.rglob("*")
        if path.name in {"token", "bus", "pulses"}
    ]
    assert len(hidden) == 12
    for container in secure.site.containers().values():
        assert not [secret for secret in hidden if secret in str(container["Config"])]


async def test_a_token_gives_access_by_https(viewer: aiohttp.ClientSession, tmp_path: Path) -> None:
    number = await _visible_person(viewer)
    out = tmp_path / "best.mp4"
    async with viewer.get(f"/objects/{number}/best.mp4") as answer:
        assert answer.status == 200
        out.write_bytes(await answer.content.readexactly(300_000))
    with av.open(str(out)) as video:
        assert len(list(islice(video.decode(video=0), 25))) == 25
    async with viewer.get("/") as page:
        assert page.status == 200


async def test_without_a_token_access_is_refused(viewer: aiohttp.ClientSession) -> None:
    number = await _visible_person(viewer)
    for path in ("/api/objects", "/api/cameras", "/metrics", f"/objects/{number}/best.mp4"):
        async with viewer.get(path, headers={"Authorization": ""}) as answer:
            assert answer.status == 401, path
        async with viewer.get(path, headers={"Authorization": "Bearer wrong"}) as answer:
            assert answer.status in {401, 429}, path


async def test_a_cameras_token_shows_only_that_camera(secure: Secure, viewer: aiohttp.ClientSession) -> None:
    token = (secure.secrets / "cameras" / "c0" / "token").read_text("ascii").strip()
    async with viewer.get("/api/cameras", headers={"Authorization": f"Bearer {token}"}) as answer:
        assert [camera["camera"] for camera in (await answer.json())["cameras"]] == ["c0"]


async def test_strangers_on_the_bus_are_ignored(secure: Secure, viewer: aiohttp.ClientSession) -> None:
    """Even in the site's network; only a message with a valid password is received."""
    network, before = secure.site.network, await _bad_messages(viewer)
    authority = "/run/public/authority.pem"

    async def publish(*arguments: str, on: str = network) -> str:
        return await asyncio.to_thread(secure.run_stranger, *arguments, network=on)

    assert "refused" in await publish(BUS, STATUS, on="bridge"), "another network"
    assert "refused" in await publish("tcp/bestview:7447", STATUS), "no encryption"
    assert "refused" in await publish(BUS, STATUS), "no certificate authority"
    await publish(BUS, STATUS, authority)
    await publish(BUS, STATUS, authority, "c1", "guessed")
    await publish(BUS, STATUS, authority, "somebody", "guessed")
    name, password = (secure.secrets / "cameras" / "c0" / "bus").read_text("ascii").strip().split(":")
    await publish(BUS, STATUS, authority, name, password)  # c0 may not publish for c1
    assert await _bad_messages(viewer) == before
    assert "published" in await publish(BUS, STATUS.replace("c1", "c0"), authority, name, password)
    assert await _bad_messages(viewer) > before


async def test_a_revoked_token_is_refused(secure: Secure, viewer: aiohttp.ClientSession) -> None:
    """The file is replaced, as editors do, without a restart."""
    tokens = secure.secrets / "web" / "tokens.yaml"
    lines = tokens.read_text("utf-8").splitlines(keepends=True)
    assert (await viewer.get("/api/site")).status == 200
    replacement = tokens.with_suffix(".new")
    replacement.write_text("".join(line for line in lines if "operator" not in line), encoding="utf-8")
    replacement.replace(tokens)
    async with asyncio.timeout(10):
        while (await viewer.get("/api/site")).status != 401:  # noqa: ASYNC110
            await asyncio.sleep(0.2)
