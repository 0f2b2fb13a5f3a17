"""Accessibility violations of a page, by axe-core."""

from __future__ import annotations

from typing import Any

from fakes.page.browser import Visit
from fakes.paths import AXE

SERIOUS = ("serious", "critical")


async def violations(visit: Visit) -> list[Any]:
    """Return the serious violations: rule, help and elements."""
    await visit.page.add_script_tag(path=AXE)
    found = await visit.get("axe.run()")
    return [
        (violation["id"], violation["help"], [node["html"] for node in violation["nodes"]])
        for violation in found["violations"]
        if violation["impact"] in SERIOUS
    ]
