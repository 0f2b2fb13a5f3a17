"""Where the repository's files are, for tests that read them."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = ROOT / "configs"
DOCS = ROOT / "docs"
PAGE = ROOT / "client" / "page"
AXE = ROOT / "node_modules" / "axe-core" / "axe.min.js"
