"""Write what MyView is made of, with licenses, as a CycloneDX SBOM: `make sbom`; the Dockerfile, for images.

`cyclonedx-py` lists the Python packages. This adds what it does not see: native libraries and crates inside
the wheels and, for an image, the interpreter and Debian's packages.
"""

from __future__ import annotations

import argparse
import json
import platform
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from importlib.metadata import Distribution, distributions
from pathlib import Path
from typing import Any

from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
UNKNOWN = "unknown"
_DOC = Path("/usr/share/doc")
_LIBRARY = re.compile(r"(?P<name>.+?)(?:-[0-9a-f]{8})+(?:\.[\d.]+)?\.so[\d.]*$")
"""A library that auditwheel has put into a wheel: its name, hashes, and versions on either side of `.so`."""
_STAND_IN = "myview-unused-plugins"
"""The empty package of the Dockerfile."""
_FIELDS = ("type", "name", "version", "scope", "purl", "licenses")
_MACHINE_READABLE = re.compile(r"^Format:.*copyright-format", re.MULTILINE)
_LICENSE_FIELD = re.compile(r"^License: *(\S.*)$", re.MULTILINE)
_COMMON_LICENSE = re.compile(r"/usr/share/common-licenses/([\w.+-]*\w)")

Component = dict[str, Any]


def list_packages(python: Path, pyproject: Path) -> dict[str, Any]:
    """Return the SBOM of the Python packages in an environment; MyView is its main component."""
    words = ["--pyproject", str(pyproject), "--output-reproducible", "--no-validate"]  # validated at the end
    command = [sys.executable, "-m", "cyclonedx_py", "environment", str(python), *words]
    done = subprocess.run(command, check=True, capture_output=True)  # noqa: S603 — words of ours
    sbom: dict[str, Any] = json.loads(done.stdout)
    return sbom


def installed_in(python: Path) -> dict[str, Distribution]:
    """Return the distributions of an environment by normalized name."""
    code = "import sysconfig; print(sysconfig.get_path('platlib'))"
    folder = subprocess.check_output([python, "-c", code], text=True).strip()  # noqa: S603 — words of ours
    return {canonicalize_name(found.name): found for found in distributions(path=[folder])}


def required_by(requirements: Iterable[str], installed: dict[str, Distribution]) -> set[str]:
    """Return what these requirements bring in here, by normalized name, without optional extras."""
    found: set[str] = set()
    pending = [(text, "") for text in requirements]
    while pending:
        text, extra = pending.pop()
        requirement = Requirement(text)
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": extra}):
            continue
        name = canonicalize_name(requirement.name)
        wanted = requirement.extras if name in found else {"", *requirement.extras}
        found.add(name)
        pending += [(each, of) for of in wanted for each in installed[name].requires or ()]
    return found


def keep_packages(sbom: dict[str, Any], names: set[str]) -> None:
    """Remove the packages that are not among these names."""
    sbom["components"] = [each for each in sbom["components"] if canonicalize_name(each["name"]) in names]
    kept = {each["bom-ref"] for each in sbom["components"]} | {sbom["metadata"]["component"]["bom-ref"]}
    sbom["dependencies"] = [
        {"ref": each["ref"], "dependsOn": [ref for ref in each.get("dependsOn", ()) if ref in kept]}
        for each in sbom["dependencies"]
        if each["ref"] in kept
    ]


def native_components(found: Distribution, licenses: dict[str, dict[str, str]]) -> Iterator[Component]:
    """Yield the libraries and crates in a wheel: its files, what they have linked in, and its own SBOMs."""
    wheel = canonicalize_name(found.name)
    known = licenses.get(wheel, {}) | licenses["any wheel"]
    for file in found.files or ():
        matched = _LIBRARY.match(file.name)
        if matched and Path(str(found.locate_file(file))).exists():
            name = matched["name"]
            where = {"occurrences": [{"location": str(file)}]}
            license_ = known.get(name, UNKNOWN)
            yield _component(name, license_) | {"evidence": where}
        elif file.parent.name == "sboms" and file.name != "auditwheel.cdx.json":  # which names no license
            for each in json.loads(file.read_text(encoding="utf-8"))["components"]:
                yield {key: each[key] for key in _FIELDS if each.get(key)}
    for name, license_ in licenses.get(f"linked into {wheel}", {}).items():
        yield _component(name, license_)


def _component(name: str, license_: str, **more: str) -> Component:
    named = {"license": {"name": UNKNOWN}} if license_ == UNKNOWN else {"expression": license_}
    return {"type": "library", "name": name, "licenses": [named], **more}


def debian_components() -> Iterator[Component]:
    """Yield the installed Debian packages, with licenses as Debian names them."""
    fields = "${db:Status-Abbrev}\t${Package}\t${Version}\t${Architecture}\n"
    command = ["dpkg-query", "--show", f"--showformat={fields}"]
    listed = subprocess.check_output(command, text=True)  # noqa: S603 — words of ours
    for status, name, version, architecture in (line.split("\t") for line in listed.splitlines()):
        if status.startswith("ii") and name != _STAND_IN:
            names = debian_licenses(_DOC / name / "copyright") or [UNKNOWN]
            yield {
                "type": "library",
                "name": name,
                "version": version,
                "purl": f"pkg:deb/debian/{name}@{version.replace('+', '%2B')}?arch={architecture}",
                "licenses": [{"license": {"name": each}} for each in names],
            }


def debian_licenses(path: Path) -> list[str]:
    """Return the licenses in a package's copyright file; none if it is missing, as in trimmed images."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    pattern = _LICENSE_FIELD if _MACHINE_READABLE.search(text) else _COMMON_LICENSE
    return sorted({each.strip() for each in pattern.findall(text)})


def without_license(components: Iterable[Component]) -> Iterator[str]:
    """Yield the names of components, nested ones included, whose license is not known."""
    for each in components:
        names = [choice.get("license", {}).get("name") for choice in each.get("licenses", ())]
        if not names or UNKNOWN in names:
            yield each["name"]
        yield from without_license(each.get("components", ()))


def build_sbom(python: Path, pyproject: Path, *, is_image: bool) -> dict[str, Any]:
    """Return the SBOM of an image, or of what MyView needs of an environment that also has other packages."""
    project = tomllib.loads(pyproject.read_text(encoding="utf-8"))["project"]
    licenses = tomllib.loads((Path(__file__).with_name("native_licenses.toml")).read_text(encoding="utf-8"))
    installed = installed_in(python)
    sbom = list_packages(python, pyproject)
    keep_packages(
        sbom,
        set(installed) - {project["name"]} if is_image else required_by(project["dependencies"], installed),
    )
    for component in sbom["components"]:
        wheel = installed[canonicalize_name(component["name"])]
        if nested := list(native_components(wheel, licenses)):
            component["components"] = nested
    if is_image:
        version = platform.python_version()
        sbom["components"] += [
            _component("python", "PSF-2.0", version=version, purl=f"pkg:generic/python@{version}"),
            *debian_components(),
        ]
    return sbom


def main() -> None:
    """Write the SBOM, and name on stderr what has no known license."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--python", type=Path, default=Path(sys.executable), help="of the environment")
    parser.add_argument("--pyproject", type=Path, default=ROOT / "pyproject.toml")
    parser.add_argument(
        "--image", action="store_true", help="all packages, the interpreter, and Debian's packages"
    )
    parser.add_argument("out", type=Path)
    options = parser.parse_args()
    sbom = build_sbom(options.python, options.pyproject, is_image=options.image)
    text = json.dumps(sbom, indent=1) + "\n"
    if (invalid := JsonStrictValidator(SchemaVersion.V1_6).validate_str(text)) is not None:
        sys.exit(f"not a valid SBOM: {invalid}")
    if unknown := sorted(set(without_license(sbom["components"]))):
        print(f"no known license: {', '.join(unknown)}", file=sys.stderr)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
