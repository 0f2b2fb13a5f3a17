"""The SBOM lists what MyView needs with licenses, native libraries inside the wheels included."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from fakes.paths import ROOT
from fakes.timeouts import PATIENCE

pytestmark = pytest.mark.slow

_WINDOWS_ONLY = {"colorama"}
_LOCKED = re.compile(r"^(?P<requirement>\S+==\S+(?: ; .*)?)\n(?P<via>(?:    #.*\n)+)", re.MULTILINE)


def locked_runtime() -> dict[str, str]:
    """Return the versions in the lock file of what the project's dependencies bring in here."""
    versions: dict[str, str] = {}
    parents: dict[str, set[str]] = {}
    for match in _LOCKED.finditer((ROOT / "requirements" / "lock.txt").read_text(encoding="utf-8")):
        requirement = Requirement(match["requirement"])
        if requirement.marker is None or requirement.marker.evaluate():
            versions[requirement.name] = str(requirement.specifier).removeprefix("==")
            parents[requirement.name] = set(match["via"].replace("# via", "#").replace("#", "").split())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    found = {canonicalize_name(Requirement(text).name) for text in project["dependencies"]}
    while more := {name for name, via in parents.items() if via & found} - found - _WINDOWS_ONLY:
        found |= more
    return {name: versions[name] for name in found}


@pytest.fixture(scope="module")
def sbom(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    out = tmp_path_factory.mktemp("sbom") / "build" / "sbom.cdx.json"
    done = subprocess.run(
        [sys.executable, ROOT / "requirements" / "sbom.py", out],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == "", "everything has a known license"
    content: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
    return content


def licenses(component: dict[str, Any]) -> list[str]:
    """Return the licenses of a component: SPDX expressions, identifiers, or names."""
    found = [choice.get("expression") or choice["license"] for choice in component.get("licenses", ())]
    return [each if isinstance(each, str) else each.get("id") or each["name"] for each in found]


def nested(sbom: dict[str, Any], package: str) -> dict[str, list[str]]:
    """Return the licenses of what is inside a package by name."""
    component = next(each for each in sbom["components"] if each["name"] == package)
    return {each["name"]: licenses(each) for each in component["components"]}


def test_it_lists_exactly_the_locked_runtime_dependencies_each_with_a_license(sbom: dict[str, Any]) -> None:
    listed = {canonicalize_name(each["name"]): each["version"] for each in sbom["components"]}
    assert listed == locked_runtime()
    assert [each["name"] for each in sbom["components"] if not licenses(each)] == []
    main = sbom["metadata"]["component"]
    assert (main["name"], licenses(main)) == ("myview", ["Apache-2.0"])


def test_it_names_the_licenses_of_native_libraries_inside_wheels(sbom: dict[str, Any]) -> None:
    av = nested(sbom, "av")
    assert av["libx264"] == av["libx265"] == ["GPL-2.0-or-later"]
    assert av["libavcodec"] == ["LGPL-3.0-or-later"]
    opencv = nested(sbom, "opencv-python-headless")
    assert opencv["libavcodec"] == ["LGPL-2.1-or-later"]
    assert "libx264" not in opencv
    assert opencv["Intel Integrated Performance Primitives"] == [
        "LicenseRef-Intel-Simplified-Software-License"
    ]
    assert nested(sbom, "eclipse-zenoh")["zenoh"] == ["EPL-2.0 OR Apache-2.0"], "crates are listed too"


def test_it_says_what_ffmpeg_itself_says_about_its_license(sbom: dict[str, Any]) -> None:
    """Linked with x264 the answer may become GPL in another wheel."""
    stated = {
        "LGPL version 3 or later": "LGPL-3.0-or-later",
        "LGPL version 2.1 or later": "LGPL-2.1-or-later",
    }
    for package in ("av", "opencv-python-headless"):
        component = next(each for each in sbom["components"] if each["name"] == package)
        library = next(each for each in component["components"] if each["name"] == "libavcodec")
        location = library["evidence"]["occurrences"][0]["location"]
        path = next(Path(folder) / location for folder in sys.path if (Path(folder) / location).exists())
        match = re.search(rb"libavcodec license: ([^\0]+)", path.read_bytes())
        assert match is not None
        assert licenses(library) == [stated[match[1].decode()]]
