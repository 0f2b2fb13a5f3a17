"""The compose files as a stack for Docker Swarm: limits, restarts, networks; and what Swarm cannot do."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from typing import Any

import pytest

from fakes.paths import ROOT

FILES = ("docker-compose.yml", "docker-compose.standby.yml")
NEEDS_COMPOSE = pytest.mark.skipif(
    shutil.which("docker") is None
    or subprocess.run(["docker", "compose", "version"], capture_output=True, check=False).returncode != 0,
    reason="needs Docker's command line with Compose; no engine",
)
PROJECT: dict[str, Any] = {
    "name": "myview",
    "networks": {"site": {"internal": True}, "outside": None},
    "services": {
        "bestview": {
            "image": "myview",
            "build": {"context": "."},
            "command": ["bestview", "configs/demo.yaml"],
            "depends_on": {"sync": {"condition": "service_started"}},
            "restart": "unless-stopped",
            "cpus": 2,
            "mem_limit": "2147483648",
            "memswap_limit": "2147483648",
            "pids_limit": 512,
            "networks": {"site": None, "outside": None},
            "ports": [{"target": 8080, "published": "8080", "protocol": "tcp", "mode": "ingress"}],
            "tmpfs": ["/memory:size=256m"],
            "volumes": [
                {"type": "bind", "source": "/a", "target": "/b", "read_only": True, "bind": {"x": True}}
            ],
        }
    },
    "x-service": {"image": "myview"},
}


def convert(project: object) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, str(ROOT / "configs" / "swarm.py")]
    return subprocess.run(words, input=json.dumps(project), capture_output=True, text=True, check=False)


def test_limits_and_restarts_are_where_swarm_looks_for_them() -> None:
    stack = json.loads(convert(PROJECT).stdout)
    (service,) = stack["services"].values()
    assert service["deploy"] == {
        "endpoint_mode": "dnsrr",
        "resources": {"limits": {"cpus": "2", "memory": "2147483648", "pids": 512}},
        "restart_policy": {"condition": "any", "delay": "1s"},
    }
    assert service["volumes"] == [
        {"type": "bind", "source": "/a", "target": "/b", "read_only": True},
        {"type": "tmpfs", "target": "/memory", "tmpfs": {"size": 256 << 20}},
    ]
    assert service["ports"] == [{"target": 8080, "published": 8080, "mode": "host"}]
    assert not {"build", "depends_on", "restart", "mem_limit", "tmpfs"} & set(service)
    assert stack["networks"] == {
        "site": {"driver": "overlay", "internal": True},
        "outside": {"driver": "overlay"},
    }


def test_a_camera_is_not_ended_while_its_source_or_the_best_view_is_away() -> None:
    health = {"test": ["CMD", "check"], "interval": "5s", "timeout": "10s", "retries": 3}
    service = {**PROJECT["services"]["bestview"], "healthcheck": health}
    camera = {**service, "command": ["camera", "configs/demo.yaml", "c0"]}
    done = convert({**PROJECT, "services": {"bestview": service, "c0": camera}})
    checks = {name: made["healthcheck"] for name, made in json.loads(done.stdout)["services"].items()}
    assert checks["c0"] == {"disable": True}
    assert checks["bestview"] == {**health, "timeout": "30s", "retries": 6}


def test_a_port_of_this_machine_alone_is_not_published_to_all() -> None:
    service = {**PROJECT["services"]["bestview"]}
    service["ports"] = [{**service["ports"][0], "host_ip": "127.0.0.1"}]
    done = convert({**PROJECT, "services": {"bestview": service}})
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "MYVIEW_PUBLISH=8080" in done.stderr


@pytest.mark.parametrize("project", [{}, [], "text", {"services": {"a": 1}, "networks": {}}])
def test_anything_else_is_refused_in_one_line(project: object) -> None:
    done = convert(project)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "docker compose config" in done.stderr


@NEEDS_COMPOSE
def test_docker_accepts_the_stack_of_a_site_with_two_services() -> None:
    named = [word for name in FILES for word in ("-f", name)]
    composed = subprocess.run(
        ["docker", "compose", *named, "config", "--format", "json"],
        cwd=ROOT,
        env={**os.environ, "MYVIEW_PUBLISH": "8080", "MYVIEW_PUBLISH_1": "8081"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert composed.returncode == 0, composed.stderr
    stack = convert(json.loads(composed.stdout)).stdout
    done = subprocess.run(
        ["docker", "stack", "config", "-c", "-"], input=stack, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    services = json.loads(stack)["services"]
    assert set(services) == {"sync", "bestview", "bestview-1", "c0", "c1", "c2"}
    assert all(service["read_only"] and service["healthcheck"] for service in services.values())
