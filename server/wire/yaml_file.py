"""Reading YAML, whatever is in the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from server.wire.errors import UserError

_SHOWN = 300
"""Characters of what a library says that a line of ours repeats."""


def read_yaml(path: Path, what: str) -> Any:
    """Read a file's content; ``what`` names it for people.

    Raises:
        UserError: it cannot be read, or is no YAML.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise UserError(f"{path}: cannot read {what}: {reason}") from error
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise UserError(f"{path}: is not valid YAML: {' '.join(str(error).split())[:_SHOWN]}") from error
    except RecursionError as error:
        raise UserError(f"{path}: is not valid YAML: brackets within brackets without end") from error
    except (ValueError, LookupError, TypeError, AttributeError) as error:  # how PyYAML says `!!int x` is none
        raise UserError(f"{path}: is not valid YAML: a date, a number or a tag that cannot be one") from error
