"""Free TCP ports."""

from __future__ import annotations

from server.cli.generated_config import free_port

__all__ = ["free_port"]
