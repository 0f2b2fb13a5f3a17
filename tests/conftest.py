"""Fixtures and settings of all tests."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from xdist.scheduler import LoadFileScheduling

from fakes.paths import ROOT

_SITES = "tests/e2e/"
"""Tests that share running sites, and therefore one worker."""

_REAL_TIME_FOLDERS = (_SITES, "tests/client/page/", "tests/server/http/operator/", "tests/server/setup/")
"""Folders whose tests mostly wait."""
_REAL_TIME_WORKERS = 3
"""At most so many workers run tests that mostly wait: the others keep the processors busy meanwhile."""

# No deadline per example, since that depends on the machine; a hanging test hits its timeout.
# All runs try the same examples, so that no run fails by chance; `make test-slow` tries others, and more.
settings.register_profile(
    "fixed examples",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize=True,
    max_examples=25,
)
settings.register_profile(
    "new examples", settings.get_profile("fixed examples"), derandomize=False, max_examples=200
)
settings.load_profile("fixed examples")

# As in every process of a site: further threads would only spin.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# No test depends on the networks that the user has installed.
os.environ["MYVIEW_MODELS"] = str(ROOT / "tests" / "no-networks")

if sys.dont_write_bytecode:
    # Compiling takes half of a command's start, and tests start hundreds. The cache is inside .venv.
    sys.dont_write_bytecode = False
    sys.pycache_prefix = str(Path(sys.prefix) / ".bytecode")
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A background process of a shell ignores Ctrl-C, and so would the processes that tests interrupt.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Start with sites and browsers, which take longest."""
    items.sort(key=lambda item: [not item.nodeid.startswith(folder) for folder in _REAL_TIME_FOLDERS])


class _RealTimeScheduling(LoadFileScheduling):
    """Runs the tests of a file on one worker, and so all sites."""

    def _split_scope(self, nodeid: str) -> str:
        file: str = super()._split_scope(nodeid)
        return _SITES if file.startswith(_SITES) else file

    def _assign_work_unit(self, node: Any) -> None:
        waiting = sum(
            any(_is_real_time(scope) and not all(tests.values()) for scope, tests in files.items())
            for other, files in self.assigned_work.items()
            if other is not node
        )
        other_file = next((scope for scope in self.workqueue if not _is_real_time(scope)), None)
        if waiting >= _REAL_TIME_WORKERS and other_file is not None:
            self.workqueue.move_to_end(other_file, last=False)
        super()._assign_work_unit(node)


def _is_real_time(name: str) -> bool:
    return name.startswith(_REAL_TIME_FOLDERS)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> _RealTimeScheduling:
    return _RealTimeScheduling(config, log)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Return the folder of real multi-view recordings, which are not in the repository; skip without it."""
    default = ROOT.parent / "shared" / "data"
    folder = Path(os.environ.get("MYVIEW_TEST_DATA", default))
    if not folder.is_dir():
        pytest.skip(f"needs the recordings in {folder} (or in the folder that MYVIEW_TEST_DATA names)")
    return folder
