"""The service of systemd as documented, in a container: install, reload, restart, stop, a wrong file."""

from __future__ import annotations

import contextlib
import os
import time
import uuid
from collections.abc import Iterator

import pytest

from benchmarks.faults.site.compose_site import missing_requirement
from benchmarks.faults.site.docker_command import COMMAND_S, DockerError, run_command
from conventions import PRODUCT
from fakes.paths import ROOT
from fakes.timeouts import PATIENCE

pytestmark = [pytest.mark.live, pytest.mark.slow, pytest.mark.timeout(1800)]

INSTALL_S = 900.0
DOCKERFILE = """
FROM python:3.11-slim-bookworm
RUN apt-get update -qq \\
    && apt-get install -y -qq --no-install-recommends systemd systemd-sysv >/dev/null
CMD ["/lib/systemd/systemd"]
"""
SOURCES = (
    *PRODUCT,
    "logthrottle",
    "expbackoff",
    "configs",
    "requirements",
    "pyproject.toml",
    "README.md",
    "LICENSE",
)
UNIT = "myview@demo"


class Machine:
    """A container in which systemd runs."""

    def __init__(self, name: str) -> None:
        self.name = name

    def run(self, *words: str, check: bool = True, seconds: float = COMMAND_S) -> str:
        command = ["docker", "exec", self.name, *words]
        return run_command(command, os.environ, check=check, seconds=seconds)

    def copy(self, source: str, target: str) -> None:
        run_command(["docker", "cp", source, f"{self.name}:{target}"], os.environ)

    def until(self, *words: str) -> None:
        """Wait until a command succeeds."""
        deadline = time.monotonic() + PATIENCE
        while True:
            try:
                self.run(*words)
            except DockerError:
                assert time.monotonic() < deadline, self.run("journalctl", "--no-pager", "--unit", "myview@*")
                time.sleep(0.5)  # nothing tells when a command will succeed
            else:
                return

    def until_served(self) -> None:
        address = "http://127.0.0.1:8080/healthz"
        self.until("python3", "-c", f"import urllib.request; urllib.request.urlopen({address!r})")

    def until_logged(self, unit: str, text: str) -> None:
        self.until("sh", "-c", f"journalctl --no-pager --unit {unit} | grep -q '{text}'")

    def shows(self, unit: str, name: str) -> str:
        """Return a property of a unit."""
        return self.run("systemctl", "show", "--value", "--property", name, unit)


def documented_commands() -> str:
    """Return the commands by which the documentation installs and starts the service `myview@hall`."""
    text = (ROOT / "docs" / "how-to" / "run.md").read_text(encoding="utf-8")
    return text.partition("### As a service of systemd")[2].split("```")[1]


@pytest.fixture(scope="module")
def machine() -> Iterator[Machine]:
    missing = missing_requirement()
    if missing is not None:
        pytest.skip(missing)
    name = f"myview-test-{uuid.uuid4().hex[:8]}"
    try:
        run_command(
            ["docker", "build", "--quiet", "--tag", name, "-"], os.environ, text=DOCKERFILE, seconds=INSTALL_S
        )
        # systemd takes file systems of its own, and control groups.
        memory = [word for folder in ("/run", "/run/lock", "/tmp") for word in ("--tmpfs", folder)]  # noqa: S108
        run_command(["docker", "run", "--detach", "--privileged", "--name", name, *memory, name], os.environ)
        running = Machine(name)
        running.until("systemctl", "is-system-running", "--wait")
        running.run("mkdir", "/src")
        for source in SOURCES:
            running.copy(source, "/src/")
        commands = f"cd /src; set -e{documented_commands()}"
        running.run("sh", "-c", commands, seconds=INSTALL_S)
        yield running
    finally:
        with contextlib.suppress(DockerError):
            run_command(["docker", "rm", "--force", name], os.environ)
        run_command(["docker", "rmi", "--force", name], os.environ, check=False)


def test_the_documented_commands_start_a_site_whose_passwords_others_cannot_read(machine: Machine) -> None:
    machine.until_served()
    assert machine.shows("myview@hall", "ActiveState") == "active"
    mode = ["stat", "--format", "%a %U"]
    assert machine.run(*mode, "/etc/myview", "/etc/myview/hall.yaml") == "750 myview\n600 myview"
    machine.run("systemctl", "disable", "--now", "myview@hall")
    assert machine.shows("myview@hall", "Result") == "success"


def test_a_site_runs_reloads_returns_after_a_kill_and_stops(machine: Machine) -> None:
    for name in ("demo.yaml", "room.ground.json"):
        machine.run("install", "--owner", "myview", f"/src/configs/{name}", "/etc/myview/")
    machine.run("systemctl", "start", UNIT)
    machine.until_served()
    machine.run("systemctl", "reload", UNIT)
    machine.until_logged(UNIT, "configuration reloaded")
    machine.run("sh", "-c", f"kill -KILL {machine.shows(UNIT, 'MainPID')}")
    machine.until("sh", "-c", f"test $(systemctl show --value --property NRestarts {UNIT}) = 1")
    machine.until_served()
    machine.run("systemctl", "stop", UNIT)
    assert machine.shows(UNIT, "Result") == "success"


def test_a_wrong_configuration_is_not_tried_again(machine: Machine) -> None:
    machine.run("sh", "-c", "echo 'cameras: 3' > /etc/myview/wrong.yaml")
    machine.run("systemctl", "start", "myview@wrong")
    machine.until("systemctl", "is-failed", "myview@wrong")
    machine.until_logged("myview@wrong", "cameras: Input should be a valid list")
    assert machine.shows("myview@wrong", "NRestarts") == "0"
