"""A site in containers by docker-compose.yml: build, start, inspect, remove."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import shutil
import subprocess
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.common.environment import ROOT, CannotRunError
from benchmarks.faults.site.docker_command import COMMAND_S, DockerError, run_command
from server.cli.generated_config import free_port

PLAIN = (ROOT / "docker-compose.yml",)
_BUILD_S = 900.0
"""Seconds: a build without cache downloads some 250 MB."""
_UP_S = 300.0


@dataclass(frozen=True, slots=True)
class ComposeSite:
    """A running Compose project."""

    project: str
    files: tuple[Path, ...]
    environment: Mapping[str, str]

    def run(self, *words: str, seconds: float = COMMAND_S, check: bool = True) -> str:
        """Run a command; return its output.

        Raises:
            DockerError: the command fails or times out.
        """
        return run_command(words, self.environment, seconds=seconds, check=check)

    def compose(self, *words: str, seconds: float = COMMAND_S, check: bool = True) -> str:
        """Run ``docker compose`` for this project."""
        named = [word for file in self.files for word in ("--file", str(file))]
        return self.run("docker", "compose", *named, *words, seconds=seconds, check=check)

    async def docker(self, *words: str) -> str:
        """Run ``docker`` in a thread."""
        return await asyncio.to_thread(self.run, "docker", *words)

    def up(self) -> None:
        """Start all services, and wait until they are healthy.

        Raises:
            DockerError: a service does not become healthy; the text has the logs.
        """
        words = ("up", "--detach", "--no-build", "--wait", "--wait-timeout", f"{_UP_S:.0f}")
        try:
            self.compose(*words, seconds=_UP_S + COMMAND_S)
        except DockerError as error:
            raise DockerError(f"{error}\n{self.compose('logs', check=False)}") from None

    def containers(self) -> dict[str, dict[str, Any]]:
        """Return `docker inspect` of every container by service, stopped ones included."""
        ids = self.compose("ps", "--all", "--quiet").split()
        found = json.loads(self.run("docker", "inspect", *ids)) if ids else []
        return {container["Config"]["Labels"]["com.docker.compose.service"]: container for container in found}

    def state(self, service: str) -> dict[str, Any]:
        """Return the engine's state of a service's container: when it started, how it exited."""
        found: dict[str, Any] = json.loads(
            self.run("docker", "inspect", "--format", "{{json .State}}", self.container(service))
        )
        return found

    def container(self, service: str) -> str:
        """Return the name of a service's container."""
        return f"{self.project}-{service}-1"

    @property
    def network(self) -> str:
        """The name of the site's network."""
        return f"{self.project}_site"

    def address(self) -> str:
        """Return the published address of the best view, as host:port."""
        return self.compose("port", "bestview", "8080")


def missing_requirement() -> str | None:
    """Return the missing requirement for running containers; None if there is none."""
    if shutil.which("docker") is None:
        return "needs Docker: `docker` was not found"
    for words in (["docker", "info"], ["docker", "compose", "version"]):
        try:
            answer = subprocess.run(words, capture_output=True, timeout=30, check=False).returncode
        except subprocess.TimeoutExpired:
            answer = 1
        if answer:
            return f"needs a Docker Engine with Compose: `{' '.join(words)}` fails"
    return None


@contextlib.contextmanager
def run_compose_site(files: Sequence[Path] = PLAIN, **variables: str) -> Iterator[ComposeSite]:
    """Build and start a site; remove it at the end.

    Raises:
        CannotRunError: there is no Docker Engine.
        DockerError: the site does not start.
    """
    missing = missing_requirement()
    if missing is not None:
        raise CannotRunError(missing)
    project = f"myview-test-{uuid.uuid4().hex[:8]}"
    plain = {
        name: value for name, value in os.environ.items() if not name.startswith(("MYVIEW_", "COMPOSE_"))
    }
    environment = {
        **plain,
        "COMPOSE_PROJECT_NAME": project,
        "MYVIEW_IMAGE": project,
        "MYVIEW_PUBLISH": f"127.0.0.1:{free_port()}",  # Docker would choose another port after a restart
        **variables,
    }
    site = ComposeSite(project, tuple(files), environment)
    try:
        site.compose("build", seconds=_BUILD_S)
        site.up()
        yield site
    finally:
        site.compose("down", "--volumes", "--rmi", "all", "--timeout", "5", check=False)
