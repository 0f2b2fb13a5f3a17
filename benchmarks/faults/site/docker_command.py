"""Docker's command line, run in the repository."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence

from benchmarks.common.environment import ROOT

COMMAND_S = 120.0
"""Seconds that a command may take."""


class DockerError(RuntimeError):
    """A Docker command failed; the text is its output."""


def run_command(
    words: Sequence[str],
    environment: Mapping[str, str],
    *,
    text: str | None = None,
    seconds: float = COMMAND_S,
    check: bool = True,
) -> str:
    """Run a command, with a text as its input if there is one; return its output.

    Raises:
        DockerError: the command times out, or it fails and that is checked.
    """
    try:
        done = subprocess.run(
            words,
            cwd=ROOT,
            env=dict(environment),
            input=text,
            capture_output=True,
            text=True,
            timeout=seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise DockerError(f"{' '.join(words)}: has not ended after {seconds:g} s") from None
    if check and done.returncode:
        raise DockerError(f"{' '.join(words)}: exit code {done.returncode}\n{done.stdout}\n{done.stderr}")
    return done.stdout.strip()
