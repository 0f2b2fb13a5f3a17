"""``myview evaluate``: tracks and view choices against ground truth.

Raises:
    UserError: on import, where the extra ``evaluate`` is not installed.
"""

from server.system.errors import UserError

try:
    import motrics as _  # noqa: F401
except ModuleNotFoundError as missing:
    if missing.name != "motrics":
        raise
    raise UserError("evaluate: needs a library for the scores: pip install 'myview[evaluate]'") from missing
