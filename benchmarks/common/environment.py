"""Environment of the benchmarks: options, data folder, one thread per process, machine description."""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import NoReturn

ROOT = Path(__file__).resolve().parents[2]
SKIPPED = 77
"""The exit code of a skipped benchmark (as in automake)."""

ONE_THREAD = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
}
"""The matrices are small: more threads only spin on the cores of other processes."""


class CannotRunError(Exception):
    """A requirement of a benchmark is missing on this machine; the text says which."""


def parser(about: str, name: str) -> argparse.ArgumentParser:
    """Return a command line parser with the common options."""
    options = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}", description=about.splitlines()[0])
    options.add_argument(
        "--out", type=Path, default=ROOT / "out" / "bench", help="folder for plots and tables"
    )
    options.add_argument(
        "--data",
        type=Path,
        default=Path(os.environ.get("MYVIEW_TEST_DATA", ROOT.parent / "shared" / "data")),
        help="folder of recordings, one folder per scene",
    )
    return options


def command_line() -> str:
    """Return the command line of the running benchmark."""
    program = Path(sys.argv[0]).resolve()
    # Tests may run with a virtual environment that is elsewhere.
    module = (program.relative_to(ROOT) if program.is_relative_to(ROOT) else Path(program.name)).with_suffix(
        ""
    )
    name = ".".join(module.parts).removesuffix(".__main__")
    return " ".join(["python", "-m", name, *sys.argv[1:]])


def one_thread_environment() -> dict[str, str]:
    """Return the environment variables for child processes."""
    environment = {**os.environ, **ONE_THREAD}
    if environment.pop("PYTHONDONTWRITEBYTECODE", None):
        # Compiling takes half of a start; an installed MyView does it once. The cache is inside .venv.
        environment["PYTHONPYCACHEPREFIX"] = str(Path(sys.prefix) / ".bytecode")
    return environment


def machine() -> str:
    """Return a line with the machine, its load, the versions and the date."""
    load = os.getloadavg()[0]
    when = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    return (
        f"{_processor()}, {os.cpu_count()} cores, load {load:.1f} before; "
        f"Python {platform.python_version()}; commit {_commit()}; {when}"
    )


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _commit() -> str:
    commit = _git("rev-parse", "--short", "HEAD")
    changed = _git("status", "--porcelain", "--untracked-files=no")
    return (commit or "unknown") + ("+changes" if changed else "")


def _git(*arguments: str) -> str:
    try:
        done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip()


def finish(problem: CannotRunError, name: str) -> NoReturn:
    """Print why a benchmark is skipped, and exit."""
    print(f"{name}: skipped: {problem}")
    sys.exit(SKIPPED)
