"""The examples of the documents run, and the reference is complete."""

from __future__ import annotations

import asyncio
import io
import os
import re
import subprocess
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import pytest
import typer.main
from prometheus_client import CollectorRegistry

from fakes.paths import DOCS, ROOT
from fakes.service import scripted_cameras
from fakes.timeouts import PATIENCE
from server.cli.main import app as command_line
from server.config.sections import HttpSettings
from server.http.api.schema import ObjectInfo, SiteInfo
from server.http.app import make_app, serving
from server.http.metrics.http_collector import METRICS
from server.messaging import camera_status, messages
from server.service.facade.cameras import CameraInfo
from server.service.facade.view_selection import ViewSelection
from server.service.pipeline import BestViewPipeline
from server.service.service import BestViewService

PAGES = sorted(DOCS.rglob("*.md"))
TUTORIALS = sorted((DOCS / "tutorials").glob("*.md"))


def reference(page: str) -> str:
    """Return the text of a page of the reference."""
    return (DOCS / "reference" / f"{page}.md").read_text(encoding="utf-8")


URL = "http://localhost:8080"
_BLOCK = re.compile(
    r"^```python runnable\n(.*?)^```\n(?:\n```text output\n(.*?)^```\n)?", re.DOTALL | re.MULTILINE
)
_NUMBER = re.compile(r"\d+(?:[./]\d+)?")
_TEST = re.compile(r"`((?:tests/(?:\w+/)*)?test_\w+\.py)(?:::(test_\w+))?`")


@dataclass(frozen=True)
class Example:
    """A block of Python in a document, and its documented output."""

    place: str
    code: str
    output: str | None


def examples() -> Iterator[Example]:
    for path in PAGES:
        text = path.read_text(encoding="utf-8")
        for found in _BLOCK.finditer(text):
            line = text[: found.start()].count("\n") + 1
            yield Example(f"{path.name}:{line}", found[1], found[2])


EXAMPLES = list(examples())


@pytest.fixture
def cameras_module() -> Any:
    """Return the module of scripted cameras."""
    return scripted_cameras


@pytest.fixture
async def site(cameras_module: Any) -> AsyncIterator[str]:
    """Serve a site that shows two people; yield its address."""
    service = cameras_module.FedService(cameras_module.small_config())
    service.decider.people._registry = cameras_module.TrackNumbers()
    async with serving(make_app(BestViewService(service)), HttpSettings(port=0)) as port:
        service.connect_cameras(*cameras_module.CAMERAS)
        for epoch in range(3):
            service.feed(
                epoch,
                {"c0": {1: cameras_module.SMALL, 2: cameras_module.SMALL}, "c1": {1: cameras_module.LARGE}},
            )
        yield f"http://127.0.0.1:{port}"
    service.close()


@pytest.mark.parametrize("example", EXAMPLES, ids=[example.place for example in EXAMPLES])
async def test_an_example_runs_and_prints_the_documented_output(example: Example, site: str) -> None:
    code = compile(example.code.replace(URL, site), example.place, "exec")
    printed = io.StringIO()

    def run() -> None:
        exec(code, {"__name__": "__main__"})  # noqa: S102 — the project's documents

    with redirect_stdout(printed):
        await asyncio.wait_for(asyncio.to_thread(run), PATIENCE)
    assert printed.getvalue().strip()
    if example.output is not None:
        assert printed.getvalue() == example.output


def test_there_are_examples_of_all_libraries() -> None:
    code = "".join(example.code for example in EXAMPLES)
    for room in ("tracking", "bestview", "camsync", "client"):
        assert f"from {room} import" in code


_COMMANDS = re.compile(r"^```console\n(.*?)^```\n", re.DOTALL | re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize("path", TUTORIALS, ids=[path.stem for path in TUTORIALS])
def test_the_commands_of_a_tutorial_run(path: Path, tmp_path: Path) -> None:
    script = "\n".join(_COMMANDS.findall(path.read_text(encoding="utf-8")))
    assert "myview" in script
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    ran = subprocess.run(
        ["bash", "-eu", "-c", script],
        cwd=tmp_path,
        env={**os.environ, "PATH": programs},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr


def test_links_between_documents_are_valid() -> None:
    for path in PAGES:
        for target in re.findall(r"\]\(([^)#\s:]+)(?:#[^)]*)?\)", path.read_text(encoding="utf-8")):
            assert (path.parent / target).exists(), f"{path.name} links to {target}"


def test_links_to_headings_are_valid() -> None:
    for path in PAGES:
        for target, heading in re.findall(r"\]\(([^)#\s:]*)#([^)]+)\)", path.read_text(encoding="utf-8")):
            other = path.parent / target if target else path
            assert heading in anchors(other.read_text(encoding="utf-8")), f"{path.name}: {target}#{heading}"


def anchors(text: str) -> list[str]:
    """Return the anchors of a document: its headings and explicit ones."""
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    names = [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings]
    return [*names, *re.findall(r'<a id="([^"]+)">', text)]


def test_every_command_and_option_is_described() -> None:
    group: Any = typer.main.get_command(command_line)
    for name, command in group.commands.items():
        assert f"`myview {name}" in reference("cli")
        rows = option_rows(name)
        for option in (flag for param in command.params for flag in param.opts if flag.startswith("--")):
            assert option == "--help" or f"`{option}`" in rows, f"myview {name} {option}"


def option_rows(command: str) -> str:
    """Return the rows of the table of a command's options."""
    rows, belongs = [], False
    for line in reference("cli").splitlines():
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) == 6:  # a table of four columns
            belongs = command in cells[1].split(", ") if cells[1] else belongs
            if belongs:
                rows.append(line)
    return "\n".join(rows)


async def test_every_path_is_described(cameras_module: Any) -> None:
    app = make_app(BestViewService(BestViewPipeline(cameras_module.small_config())))
    paths = {route.resource.canonical for route in app.router.routes() if route.resource is not None}
    assert len(paths) > 10
    described = reference("http-api") + reference("streams")
    for path in sorted(paths):
        plain = re.sub(r"\{(\w+)(:[^/]*)?\}(?=[/.]|$)", r"{\1}", path)
        assert f"`{plain}`" in described, plain


@pytest.mark.parametrize("kind", [SiteInfo, ObjectInfo, CameraInfo, ViewSelection])
def test_every_field_of_an_answer_is_described(kind: type[msgspec.Struct]) -> None:
    http = reference("http-api")
    for field in msgspec.structs.fields(kind):
        assert f"`{field.encode_name}`" in http, field.encode_name


def test_every_field_of_a_message_is_described() -> None:
    zenoh = reference("messages")
    kinds = [
        kind
        for kind in [*vars(messages).values(), *vars(camera_status).values()]
        if isinstance(kind, type) and issubclass(kind, msgspec.Struct)
    ]
    assert len(kinds) > 5
    for kind in kinds:
        part = zenoh.partition(f"**`{kind.__name__}`**")[2]
        assert part, kind.__name__
        for field in msgspec.structs.fields(kind):
            assert f"`{field.encode_name}`" in part, f"{kind.__name__}.{field.encode_name}"


async def test_every_metric_is_described(cameras_module: Any) -> None:
    service = BestViewPipeline(cameras_module.small_config())
    metrics: CollectorRegistry = make_app(BestViewService(service))[METRICS]
    names = [
        f"{metric.name}_total" if metric.type == "counter" else metric.name for metric in metrics.collect()
    ]
    for name in [name for name in names if name.startswith("myview_")]:
        assert f"`{name}`" in reference("metrics"), name


def test_every_test_that_a_document_names_exists() -> None:
    named = [
        (path.name, file, test)
        for path in (*PAGES, ROOT / "CONTRIBUTING.md")
        for file, test in _TEST.findall(path.read_text(encoding="utf-8"))
    ]
    for document, file, test in named:
        assert (ROOT / file).is_file(), f"{document}: {file}"
        assert not test or f"def {test}(" in (ROOT / file).read_text(encoding="utf-8"), f"{document}: {test}"


def test_every_figure_of_the_readme_is_measured() -> None:
    table = (ROOT / "README.md").read_text(encoding="utf-8").partition("## Figures")[2].partition("\n## ")[0]
    measured = set(_NUMBER.findall((DOCS / "measurements.md").read_text(encoding="utf-8")))
    shown = [
        number
        for row in table.splitlines()
        if row.startswith("| ")
        for number in _NUMBER.findall(row.split("|")[2])
    ]
    assert len(shown) > 10
    assert [number for number in shown if number not in measured] == []
