"""The unit for systemd, run by a real one in a container: start, reload, restart, stop, a wrong file."""

from __future__ import annotations

import contextlib
import os
import time
import uuid
from collections.abc import Iterator

import pytest

from benchmarks.faults.site.compose_site import missing_requirement
from benchmarks.faults.site.docker_command import DockerError, run_command
from fakes.timeouts import PATIENCE

pytestmark = [pytest.mark.live, pytest.mark.slow, pytest.mark.timeout(1800)]

BUILD_S = 900.0
DOCKERFILE = """
FROM {image}
USER root
RUN apt-get update -qq && apt-get install -y -qq --no-install-recommends systemd systemd-sysv >/dev/null \\
    && install --directory --owner myview /etc/myview
ENTRYPOINT []
CMD ["/lib/systemd/systemd"]
"""
UNIT = "myview@demo"


class Machine:
    """A container in which systemd runs."""

    def __init__(self, name: str) -> None:
        self.name = name

    def run(self, *words: str, check: bool = True) -> str:
        return run_command(["docker", "exec", self.name, *words], os.environ, check=check)

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


@pytest.fixture(scope="module")
def machine() -> Iterator[Machine]:
    missing = missing_requirement()
    if missing is not None:
        pytest.skip(missing)
    name = f"myview-test-{uuid.uuid4().hex[:8]}"
    images = [f"{name}-site", f"{name}-systemd"]
    try:
        run_command(["docker", "build", "--quiet", "--tag", images[0], "."], os.environ, seconds=BUILD_S)
        dockerfile = DOCKERFILE.format(image=images[0])
        run_command(
            ["docker", "build", "--quiet", "--tag", images[1], "-"],
            os.environ,
            text=dockerfile,
            seconds=BUILD_S,
        )
        # systemd takes file systems of its own, and control groups.
        memory = [word for folder in ("/run", "/run/lock", "/tmp") for word in ("--tmpfs", folder)]  # noqa: S108
        run_command(
            ["docker", "run", "--detach", "--privileged", "--name", name, *memory, images[1]], os.environ
        )
        running = Machine(name)
        running.until("systemctl", "is-system-running", "--wait")
        running.copy("configs/myview@.service", "/etc/systemd/system/")
        running.copy("configs/demo.yaml", "/etc/myview/")
        running.copy("configs/room.ground.json", "/etc/myview/")
        running.run("chown", "--recursive", "myview", "/etc/myview")
        running.run("systemctl", "daemon-reload")
        yield running
    finally:
        with contextlib.suppress(DockerError):
            run_command(["docker", "rm", "--force", name], os.environ)
        run_command(["docker", "rmi", "--force", *images], os.environ, check=False)


def test_a_site_runs_reloads_returns_after_a_kill_and_stops(machine: Machine) -> None:
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
