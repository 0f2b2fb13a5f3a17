"""The compose files in all combinations: limits, health checks and permissions; needs no Docker Engine."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from fakes.paths import ROOT
from server.config.loader import load_config
from server.config.site_config import Config

PLAIN, SECURE, SERVER, CAMERAS, STANDBY = (
    "docker-compose.yml",
    "docker-compose.secure.yml",
    "docker-compose.server.yml",
    "docker-compose.cameras.yml",
    "docker-compose.standby.yml",
)
VARIANTS = [
    (PLAIN,),
    (PLAIN, SECURE),
    (PLAIN, SERVER),
    (PLAIN, SECURE, SERVER),
    (PLAIN, CAMERAS),
    (PLAIN, SECURE, CAMERAS),
    (PLAIN, STANDBY),
]
SECRETS = "/run/secrets/"
NEEDS_COMPOSE = pytest.mark.skipif(
    shutil.which("docker") is None
    or subprocess.run(["docker", "compose", "version"], capture_output=True, check=False).returncode != 0,
    reason="needs Docker's command line with Compose; no engine",
)


class Loader(yaml.SafeLoader):
    """The safe loader, which ignores the merge tags of Compose."""


Loader.add_constructor("!reset", lambda *_: None)
Loader.add_constructor("!override", lambda loader, node: loader.construct_sequence(node))


def content(name: str) -> dict[str, Any]:
    found = yaml.load((ROOT / name).read_text(encoding="utf-8"), Loader=Loader)  # noqa: S506 — the safe one
    assert isinstance(found, dict)
    return found


def composed(files: tuple[str, ...], tmp_path: Path) -> dict[str, Any]:
    """Return the merged files as resolved and validated by Compose."""
    secrets = tmp_path / "secrets"
    (secrets / "public").mkdir(parents=True)
    (secrets / "web").mkdir()
    plain = {
        name: value for name, value in os.environ.items() if not name.startswith(("MYVIEW_", "COMPOSE_"))
    }
    variables = {
        "MYVIEW_SECRETS": str(secrets),
        "MYVIEW_SERVER": "10.0.0.5",
        "MYVIEW_HEALTH_URL": "https://10.0.0.5",
    }
    words = ["docker", "compose", *[word for name in files for word in ("-f", name)]]
    done = subprocess.run(
        [*words, "--profile", "*", "config", "--format", "json"],
        cwd=ROOT,
        env={**plain, **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr, "no warnings"
    found = json.loads(done.stdout)
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize("limit", ["mem_limit", "memswap_limit", "cpus", "pids_limit"])
def test_every_service_has_resource_limits(limit: str) -> None:
    for name, service in content(PLAIN)["services"].items():
        assert service.get(limit), name


def test_cameras_yield_to_the_best_view_and_the_pulses() -> None:
    """By CPU shares, since niceness has no effect between containers."""
    cameras = load_config(ROOT / "configs" / "demo.yaml").camera_ids
    default = 1024  # docker run --cpu-shares
    shares = {
        name: service.get("cpu_shares", default) for name, service in content(PLAIN)["services"].items()
    }
    assert all(shares[name] < min(shares["bestview"], shares["sync"]) for name in cameras)


def test_every_service_is_read_only_has_a_health_check_and_limits_its_log() -> None:
    for name, service in content(PLAIN)["services"].items():
        assert service["read_only"] is True, name
        assert service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert service["healthcheck"]["test"][:4] == [
            "CMD",
            "python",
            "-m",
            "server.supervisor.healthcheck",
        ], name
        assert set(service["logging"]["options"]) == {"max-size", "max-file"}, name
        assert service["init"] is True, name


@pytest.mark.parametrize("file", [PLAIN, SECURE, SERVER, CAMERAS, STANDBY])
def test_no_service_has_extra_privileges(file: str) -> None:
    for name, service in content(file)["services"].items():
        assert not {"privileged", "cap_add", "network_mode", "pid", "ipc", "userns_mode"} & set(service), name
        assert "docker.sock" not in json.dumps(service), name
        if file != PLAIN:  # overrides keep the restrictions
            kept = {"read_only", "cap_drop", "security_opt", "logging", "user", "tmpfs"}
            assert not kept & set(service), name


def test_each_service_has_only_its_secrets() -> None:
    services, secrets = content(SECURE)["services"], content(SECURE)["secrets"]
    used = {
        name: [
            secret if isinstance(secret, str) else secret["source"] for secret in service.get("secrets", ())
        ]
        for name, service in services.items()
    }
    assert used["bestview"] == ["bus", "router_key"]
    assert used["sync"] == ["pulses", "sync_key"]
    for camera in load_config(ROOT / "configs" / "demo.yaml").camera_ids:
        assert used[camera] == [f"{camera}_bus", f"{camera}_pulses", f"{camera}_token"]
    assert sorted(secrets) == sorted(source for sources in used.values() for source in sources)
    files = [secret["file"] for secret in secrets.values()]
    assert len(set(files)) == len(files)
    assert all(file.startswith("${MYVIEW_SECRETS:-./secrets}/") for file in files)


def test_the_secure_site_trusts_no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, service in content(SECURE)["services"].items():
        config = _config(
            {**content(PLAIN)["services"][name]["environment"], **service["environment"]}, monkeypatch
        )
        assert not config.access.open_to_all
        assert not config.access.trusted_network
        assert config.sync.users == Path("/run/web/pulses" if name == "bestview" else SECRETS + "pulses")
        assert config.sync.tls.authority == Path("/run/public/authority.pem")
        assert (config.sync.tls.key is not None) == (name == "sync")
        assert config.zenoh.connect.startswith("tls/")
        assert config.zenoh.listen.startswith("tls/")
        assert config.zenoh.users == Path(SECRETS + "bus")
        assert (config.access.tokens is not None) == (config.http.tls.key is not None) == (name == "bestview")


def test_two_services_know_each_other_and_every_process_knows_both(monkeypatch: pytest.MonkeyPatch) -> None:
    plain, standby = content(PLAIN)["services"], content(STANDBY)["services"]
    assert set(standby) == {*plain, "bestview-1"}, "a camera that knows one service only dies with it"
    for name, service in standby.items():
        base = plain["bestview" if name == "bestview-1" else name]["environment"]
        config = _config({**base, **service["environment"]}, monkeypatch)
        assert list(config.zenoh.routers) == ["tcp/bestview:7447", "tcp/bestview-1:7447"]
        assert config.view.sharding.services == 2
        assert config.view.sharding.index == (name == "bestview-1")
        services = service["environment"]["MYVIEW_HEALTH_URL"].split(",")
        assert services == ["http://bestview:8080", "http://bestview-1:8080"]


@pytest.mark.parametrize("file", [SERVER, CAMERAS])
def test_the_documented_env_file_has_all_required_variables(file: str) -> None:
    """Else Compose commands in another shell would lack them."""
    needed = set(re.findall(r"\$\{(MYVIEW_\w+):\?", (ROOT / file).read_text(encoding="utf-8")))
    assert needed
    text = (ROOT / "docs" / "how-to" / "containers.md").read_text(encoding="utf-8")
    blocks = [block.partition("\n")[2] for block in text.split("```")[1::2]]
    (env,) = [block for block in blocks if block.startswith("COMPOSE_FILE=") and file in block]
    assert needed | {"MYVIEW_CONFIG"} <= {line.partition("=")[0] for line in env.splitlines()}


def test_published_ports_are_the_listening_ones() -> None:
    plain, server = content(PLAIN)["services"], content(SERVER)["services"]
    published = {
        name: [port.rpartition(":")[2] for port in service["ports"]] for name, service in server.items()
    }
    assert published["sync"] == [str(plain["sync"]["environment"]["MYVIEW_SYNC__PORT"])]
    listened = plain["bestview"]["environment"]["MYVIEW_ZENOH__LISTEN"]
    assert published["bestview"] == [listened.rpartition(":")[2]]


def _config(environment: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> Config:
    with monkeypatch.context() as patch:
        for name, value in environment.items():
            if "__" in name:
                patch.setenv(name, re.sub(r"\$\{\w+:-([^}]*)\}", r"\1", str(value)))
        return load_config(ROOT / "configs" / "demo.yaml")


@NEEDS_COMPOSE
@pytest.mark.parametrize(
    "files", VARIANTS, ids=lambda variant: "+".join(name.split(".")[-2] for name in variant)
)
def test_compose_accepts_the_combined_files(files: tuple[str, ...], tmp_path: Path) -> None:
    found = composed(files, tmp_path)
    for name, service in found["services"].items():
        assert service["read_only"], name
        assert service["cap_drop"] == ["ALL"], name
        assert int(service["mem_limit"]) > 0, name
        mounted_secrets = {SECRETS + secret["target"] for secret in service.get("secrets", ())}
        named = {value for value in service["environment"].values() if value.startswith(SECRETS)}
        assert name == "sync" or named == mounted_secrets, "the configured secrets are the mounted ones"
        for mounted in service["volumes"]:
            assert mounted["read_only"], name


@NEEDS_COMPOSE
def test_pulses_and_bus_are_published_only_for_cameras_on_other_hosts(tmp_path: Path) -> None:
    def ports(files: tuple[str, ...], folder: str) -> set[tuple[str, int]]:
        services = composed(files, tmp_path / folder)["services"].values()
        return {
            (port["host_ip"], port["target"]) for service in services for port in service.get("ports", ())
        }

    assert ports((PLAIN, SECURE), "one") == {("127.0.0.1", 8080)}
    assert ports((PLAIN, SECURE, SERVER), "many") == {
        ("127.0.0.1", 8080),
        ("10.0.0.5", 7400),
        ("10.0.0.5", 7447),
    }


@NEEDS_COMPOSE
def test_the_second_service_is_published_at_an_address_of_its_own(tmp_path: Path) -> None:
    services = composed((PLAIN, STANDBY), tmp_path)["services"]
    ports = [services[name]["ports"][0]["published"] for name in ("bestview", "bestview-1")]
    assert ports == ["8080", "8081"]
    urls = json.loads(services["c0"]["environment"]["MYVIEW_VIEW__SHARDING__SERVERS"])
    assert urls == [f"http://127.0.0.1:{port}/" for port in ports]


@NEEDS_COMPOSE
def test_a_camera_host_starts_only_cameras(tmp_path: Path) -> None:
    services = composed((PLAIN, SECURE, CAMERAS), tmp_path)["services"]
    cameras = {name: service for name, service in services.items() if not service.get("profiles")}
    assert set(cameras) == {"c0", "c1", "c2"}
    for service in cameras.values():
        assert not service.get("depends_on")
        assert set(service["networks"]) == {"cameras"}
        environment = service["environment"]
        assert environment["MYVIEW_SYNC__HOST"] == "10.0.0.5"
        assert environment["MYVIEW_ZENOH__CONNECT"] == "tls/10.0.0.5:7447"
        assert environment["MYVIEW_HEALTH_URL"] == "https://10.0.0.5"
