"""The SBOM inside each image lists what is installed there."""

from __future__ import annotations

import contextlib
import json
import os
import uuid
from collections.abc import Iterator
from typing import Any

import pytest
from packaging.utils import canonicalize_name

from benchmarks.faults.site.compose_site import missing_requirement
from benchmarks.faults.site.docker_command import DockerError, run_command

pytestmark = [pytest.mark.live, pytest.mark.slow, pytest.mark.timeout(1800)]

BUILD_S = 900.0
INSTALLED = """
import importlib.metadata, json
print(json.dumps({found.name: found.version for found in importlib.metadata.distributions()}))
"""


@pytest.fixture(scope="module", params=["site", "rtsp"])
def image(request: pytest.FixtureRequest) -> Iterator[str]:
    missing = missing_requirement()
    if missing is not None:
        pytest.skip(missing)
    name = f"myview-test-{uuid.uuid4().hex[:8]}"
    build = ["docker", "build", "--quiet", "--target", request.param, "--tag", name, "."]
    try:
        run_command(build, os.environ, seconds=BUILD_S)
        yield name
    finally:
        with contextlib.suppress(DockerError):
            run_command(["docker", "rmi", "--force", name], os.environ)


def run_in(image: str, entrypoint: str, *words: str) -> str:
    return run_command(["docker", "run", "--rm", "--entrypoint", entrypoint, image, *words], os.environ)


def components(image: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(run_in(image, "cat", "/usr/share/doc/myview/sbom.cdx.json"))[
        "components"
    ]
    return found


def test_it_lists_the_python_packages_and_the_interpreter(image: str) -> None:
    installed = {
        canonicalize_name(name): version
        for name, version in json.loads(run_in(image, "python", "-c", INSTALLED)).items()
    }
    listed = {
        canonicalize_name(each["name"]): each["version"]
        for each in components(image)
        if each["purl"].startswith("pkg:pypi/")
    }
    assert listed | {"myview": installed["myview"]} == installed
    version = run_in(image, "python", "-c", "import platform; print(platform.python_version())")
    assert f"pkg:generic/python@{version}" in {each["purl"] for each in components(image)}


def test_it_lists_debians_packages(image: str) -> None:
    show = ["--show", "--showformat=${Package}=${Version}\n"]
    installed = set(run_in(image, "dpkg-query", *show).split()) - {"myview-unused-plugins=1"}
    debian = [each for each in components(image) if each["purl"].startswith("pkg:deb/")]
    assert {f"{each['name']}={each['version']}" for each in debian} == installed
    assert all(each["licenses"] for each in debian)
