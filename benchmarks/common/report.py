"""Reports: tables that are printed, and saved as text."""

from __future__ import annotations

from collections.abc import Sequence
from io import StringIO
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.common.environment import command_line, machine

_WIDTH, _WIDTH_SAVED = 110, 240
"""Characters of a line on the screen, and in a file, where lines are not wrapped."""


class Report:
    """Prints lines and tables, and records them for a text file."""

    def __init__(self) -> None:
        self._screen = Console(width=_WIDTH, highlight=False)
        self._saved = Console(width=_WIDTH_SAVED, record=True, highlight=False, file=StringIO())
        self.line(machine())
        self.line(f"$ OPENBLAS_NUM_THREADS=1 {command_line()}")

    def line(self, text: str) -> None:
        """Print a line."""
        for console in (self._screen, self._saved):
            console.print(text, markup=False)

    def table(self, title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Print a table; only text in the first and the last column is left-aligned."""
        table = Table(title=title, title_justify="left", show_header=any(columns))
        for index, column in enumerate(columns):
            is_text = index in {0, len(columns) - 1} and not _is_number(rows[0][index])
            table.add_column(column, justify="left" if is_text else "right")
        for row in rows:
            table.add_row(*row)
        for console in (self._screen, self._saved):
            console.print(table)

    def save(self, path: Path) -> None:
        """Write everything that was printed into a text file."""
        path.parent.mkdir(parents=True, exist_ok=True)
        self._saved.save_text(str(path))


def _is_number(text: str) -> bool:
    return text[:1].isdigit() or text[:1] in {"-", "+", "."}
