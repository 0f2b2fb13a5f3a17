"""Find stale names in docstrings, which renames have left behind."""

from __future__ import annotations

import ast
import builtins
import re
from collections.abc import Iterable, Iterator

from conventions import PRODUCT, parsed

_ENTRY = re.compile(r"^    (\*{0,2}[\w.]+(?:, [\w.]+)*)(?: \(.*?\))?:", re.MULTILINE)
_ROLE = re.compile(r":(?:class|func|data|meth|mod|attr|exc):`~?([\w.]+)`")
_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def stale_names() -> list[str]:
    """Return names under Args, Attributes or Raises, or in a role, that do not exist, with their places."""
    modules = [
        (path, list(ast.walk(tree)))
        for path, tree in parsed(*PRODUCT, "logthrottle", "expbackoff", "benchmarks")
    ]
    defined = {name for path, nodes in modules for name in (*path.with_suffix("").parts, *_defined_in(nodes))}
    return [
        f"{path}:{getattr(node, 'lineno', 1)} {name}"
        for path, nodes in modules
        for node in nodes
        for name in _stale_in(node, defined)
    ]


def _stale_in(node: ast.AST, defined: set[str]) -> Iterator[str]:
    """Yield the stale names of one docstring, or of the text below an attribute or constant."""
    if (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    ):
        yield from (name for name in _ROLE.findall(node.value.value) if name.split(".")[-1] not in defined)
    if not isinstance(node, _DOCUMENTED):
        return
    docstring = ast.get_docstring(node) or ""
    yield from (name for name in _entries(docstring, "Raises") if not _is_known(name, defined))
    if isinstance(node, ast.ClassDef):
        if attributes := list(_entries(docstring, "Attributes")):
            yield from set(attributes).difference(_defined_in(ast.walk(node)))
    elif not isinstance(node, ast.Module) and (listed := list(_entries(docstring, "Args"))):
        arguments = {argument.arg for argument in ast.walk(node.args) if isinstance(argument, ast.arg)}
        yield from (name for name in listed if name.strip("*") not in arguments)


def _entries(docstring: str, section: str) -> Iterator[str]:
    found = re.search(rf"^{section}:\n((?:    .*\n?|\n)+)", docstring, re.MULTILINE)
    for names in _ENTRY.findall(found[1]) if found else ():
        yield from names.split(", ")


def _is_known(name: str, defined: set[str]) -> bool:
    """Return whether an exception is built in, defined here, or qualified by its module."""
    return hasattr(builtins, name) or name.split(".", maxsplit=1)[0] in defined


def _defined_in(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """Yield all names that some syntax nodes define, assign or import."""
    for node in nodes:
        match node:
            case ast.ClassDef() | ast.FunctionDef() | ast.AsyncFunctionDef():
                yield node.name
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                yield name
            case ast.arg(arg=name):
                yield name
            case ast.alias():
                yield (node.asname or node.name).split(".")[-1]
            case _:
                pass
