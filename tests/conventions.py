"""Measure how readable the tree is, room by room: ``python tests/conventions.py`` prints the table.

A room is a package of the root, or a folder of ``server``. ``tests/test_conventions.py`` holds the bounds.
"""

from __future__ import annotations

import ast
import re
import subprocess
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[1]
PRODUCT = ("camsync", "tracking", "bestview", "synthetic", "server", "client")
_SOURCES = (".py", ".js")
_PUBLIC_CLASS = re.compile(r"^class ([^_\W]\w*)", re.MULTILINE)
_SOURCE_NAME = re.compile(r"[\w-]+\.(?:py|js)\b")
_WORD = re.compile(r"[^\W\d_]+(?:['-][^\W\d_]+)*")


@dataclass(frozen=True, slots=True)
class Room:
    """The sources of one room: modules without ``__init__.py``, sizes in lines."""

    name: str
    files: int
    median: float
    largest: int
    largest_file: str
    lines: int


def tracked(*folders: str) -> list[Path]:
    """Return the files under version control, relative to the root."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", *folders], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return [
        path for name in listed.stdout.split("\0") if name and (path := Path(name)) and (ROOT / path).exists()
    ]


def room_of(path: Path) -> str:
    """Return the room that a file belongs to."""
    parts = path.parts
    return "/".join(parts[:2]) if parts[0] == "server" and len(parts) > 2 else parts[0]


def sources(*folders: str) -> list[Path]:
    """Return the Python and JavaScript files of some folders."""
    return [path for path in tracked(*folders) if path.suffix in _SOURCES]


def rooms() -> list[Room]:
    """Measure every room of the product, the benchmarks and the tests."""
    lengths: dict[str, dict[Path, int]] = defaultdict(dict)
    for path in sources(*PRODUCT, "benchmarks", "tests"):
        lengths[room_of(path)][path] = len((ROOT / path).read_text(encoding="utf-8").splitlines())
    return [_measure(name, sizes) for name, sizes in sorted(lengths.items())]


def _measure(name: str, sizes: dict[Path, int]) -> Room:
    modules = {path: size for path, size in sizes.items() if path.name != "__init__.py"} or sizes
    largest = max(modules, key=lambda path: modules[path])
    return Room(
        name, len(sizes), median(modules.values()), modules[largest], largest.name, sum(sizes.values())
    )


def flat_folders(limit: int) -> dict[str, int]:
    """Return the folders of sources with more than ``limit`` files, and their numbers of files."""
    counts = Counter(str(path.parent) for path in sources(*PRODUCT, "benchmarks", "tests"))
    return {folder: count for folder, count in counts.items() if count > limit}


def parsed(*folders: str, having: str = "") -> Iterator[tuple[Path, ast.Module]]:
    """Parse the Python files of some folders whose text has a match of a regular expression."""
    for path in tracked(*folders):
        if path.suffix == ".py":
            text = (ROOT / path).read_text(encoding="utf-8")
            if re.search(having, text):
                yield path, ast.parse(text)


def shared_class_names() -> dict[str, list[str]]:
    """Return the public classes that share a name within a package: paths by package and name."""
    places: dict[str, list[str]] = defaultdict(list)
    for path in tracked(*PRODUCT):
        if path.suffix == ".py":
            for name in _PUBLIC_CLASS.findall((ROOT / path).read_text(encoding="utf-8")):
                places[f"{path.parts[0]}: {name}"].append(str(path))
    return {name: paths for name, paths in places.items() if len(paths) > 1}


def docstrings_beginning_with(words: Iterable[str], *folders: str) -> list[str]:
    """Return where docstrings begin with one of some words."""
    first = rf"(?:{'|'.join(words)})\b"
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    return [
        f"{path}:{getattr(node, 'lineno', 1)}"
        for path, tree in parsed(*folders, having=rf"""[\"'][\s\\]*{first}""")
        for node in ast.walk(tree)
        if isinstance(node, documented) and re.match(first, ast.get_docstring(node) or "")
    ]


def missing_sources_in_documents() -> list[str]:
    """Return where Markdown files name a module or a script that does not exist."""
    paths = tracked()
    known = {path.name for path in paths}
    return [
        f"{path}:{number}: {name}"
        for path in paths
        if path.suffix == ".md"
        for number, line in enumerate((ROOT / path).read_text(encoding="utf-8").splitlines(), start=1)
        for name in _SOURCE_NAME.findall(line)
        if name not in known
    ]


def words_of(*paths: str) -> int:
    """Count the words of Markdown files, including code and tables, without link addresses."""
    text = " ".join(
        (ROOT / path).read_text(encoding="utf-8") for path in tracked(*paths) if path.suffix == ".md"
    )
    return len(_WORD.findall(re.sub(r"\]\([^)]*\)", "]", text)))


def main() -> None:
    """Print the table."""
    print(f"{'room':28}{'files':>6}{'median':>8}{'largest':>9}  {'':34}{'lines':>8}")
    for room in rooms():
        print(
            f"{room.name:28}{room.files:6}{room.median:8.0f}{room.largest:9}  "
            f"{room.largest_file:34}{room.lines:8}"
        )
    product = sum(room.lines for room in rooms() if room.name.split("/")[0] in PRODUCT)
    print(f"\nlines of product: {product}")
    print(f"folders with more than 20 files: {flat_folders(20) or 'none'}")
    print(f"public classes that share a name within a package: {shared_class_names() or 'none'}")
    docstrings = docstrings_beginning_with(("Give", "Tell", "Say"), ".")
    print(f"docstrings that begin with Give, Tell or Say: {len(docstrings)}")
    print(f"words: README {words_of('README.md')}, docs {words_of('docs')}")


if __name__ == "__main__":
    main()
