"""The wheel and the source distribution contain the whole product, and the wheel runs outside the clone."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from conventions import PRODUCT, ROOT, tracked
from fakes.timeouts import PATIENCE

_BUILD = """
import sys
from setuptools import build_meta
folder = sys.argv[1]  # a build replaces the arguments
build_meta.build_sdist(folder)
build_meta.build_wheel(folder)
"""


def product() -> set[str]:
    return {path.as_posix() for path in tracked(*PRODUCT, "logthrottle", "expbackoff")}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build both from a copy of the tracked files; return their folder."""
    copy, out = tmp_path_factory.mktemp("copy"), tmp_path_factory.mktemp("dist")
    for path in tracked():
        (copy / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / path, copy / path)
    subprocess.run(
        [sys.executable, "-c", _BUILD, out], cwd=copy, check=True, capture_output=True, timeout=PATIENCE
    )
    return out


def test_the_wheel_contains_only_the_product(built: Path) -> None:
    with zipfile.ZipFile(next(built.glob("*.whl"))) as wheel:
        names = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert names == product()


def test_the_source_distribution_contains_the_product_and_no_tests(built: Path) -> None:
    with tarfile.open(next(built.glob("*.tar.gz"))) as archive:
        names = {member.name.partition("/")[2] for member in archive if member.isfile()}
    assert names >= product()
    assert not [name for name in names if name.startswith("tests/")]


def test_the_wheel_runs_outside_the_clone(built: Path, tmp_path: Path) -> None:
    shutil.unpack_archive(next(built.glob("*.whl")), tmp_path / "site", "zip")
    command = (
        "import runpy, server; print(server.__file__); runpy.run_module('server.cli.main', {}, '__main__')"
    )
    ran = subprocess.run(
        [sys.executable, "-c", command, "scene", "--seconds", "0.2", "--out", "room", "room"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path / "site")},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith(str(tmp_path))
    assert list((tmp_path / "room").iterdir())
