"""Tables as they are printed, and as text files beside the plots."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.surroundings import command_line, machine

_WIDTH = 110


class Report:
    """Prints lines and tables, and keeps them to be saved."""

    def __init__(self) -> None:
        self._console = Console(width=_WIDTH, record=True, highlight=False)
        self.say(machine())
        self.say(f"$ OPENBLAS_NUM_THREADS=1 {command_line()}")

    def say(self, text: str) -> None:
        """Print a line."""
        self._console.print(text, markup=False)

    def table(self, title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Print a table: words to the left in the first and last column, numbers to the right between."""
        table = Table(title=title, title_justify="left", show_header=any(columns))
        for place, column in enumerate(columns):
            words = place in {0, len(columns) - 1} and not _is_number(rows[0][place])
            table.add_column(column, justify="left" if words else "right")
        for row in rows:
            table.add_row(*row)
        self._console.print(table)

    def save(self, path: Path) -> None:
        """Write all that was printed into a text file."""
        path.parent.mkdir(parents=True, exist_ok=True)
        self._console.save_text(str(path))


def _is_number(text: str) -> bool:
    return text[:1].isdigit() or text[:1] in {"-", "+", "."}
