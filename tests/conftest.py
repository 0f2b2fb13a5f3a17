"""Fixtures that every room's tests share."""

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

_ONE_BY_ONE = ("tests/e2e/", "tests/client/")
"""Folders whose tests run in real time, and do not run beside each other."""

# How long an example takes is the machine's doing: a test that hangs is ended by its own bound in time.
# Each run tries the same examples, so that no run fails by chance; `make test-slow` looks for others.
settings.register_profile(
    "the same", deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True
)
settings.register_profile("others", settings.get_profile("the same"), derandomize=False)
settings.load_profile("the same")

# As in every process of a site: threads that compute what one does as soon wait by turning round and round.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

if sys.dont_write_bytecode:
    # Compiling is half of a command's start, and tests start hundreds. What is kept lies in .venv alone.
    sys.dont_write_bytecode = False
    sys.pycache_prefix = str(Path(sys.prefix) / ".bytecode")
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # What a shell starts in the background ignores Ctrl-C, and so would the processes that tests interrupt.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with sites and browsers, which take longest, so that they do not run alone in the end."""
    items.sort(key=lambda item: [not item.nodeid.startswith(folder) for folder in _ONE_BY_ONE])


class _OneSiteAtATime(LoadFileScheduling):
    """Keeps a file's tests on one worker, as they share fixtures, and so all sites, and so all browsers."""

    def _split_scope(self, nodeid: str) -> str:
        file: str = super()._split_scope(nodeid)
        return next((folder for folder in _ONE_BY_ONE if file.startswith(folder)), file)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> _OneSiteAtATime:
    return _OneSiteAtATime(config, log)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Return the folder of real multi-view recordings; skip without it: it is not in the repository."""
    default = ROOT.parent / "shared" / "data"
    folder = Path(os.environ.get("MYVIEW_TEST_DATA", default))
    if not folder.is_dir():
        pytest.skip(f"needs the recordings in {folder} (or in the folder that MYVIEW_TEST_DATA names)")
    return folder
