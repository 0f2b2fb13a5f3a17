"""Failover: processes of a site with two best-view services fail under viewers at both; table of promises.

    python -m benchmarks.faults.failover --out out/bench
    python -m benchmarks.faults.failover --failure "kill leading service"

The site is that of :mod:`benchmarks.faults`, tracked jointly if that is what fails, with two services behind
HAProxy (`configs/haproxy.cfg`). To be cut off, every process runs on a host of its own: a network namespace,
which needs root and iproute2. A killed process is started again after a second; others return after four
(frozen) or six (cut off). Columns:

* *others*: the longest time without new video, seconds, for viewers of the service that does not fail, none
  of whose streams may break; in brackets the same of all viewers before the failure;
* *client* (`myview watch`), *page*, *HLS*, *MP4*: likewise for viewers of the service that fails, or whose
  joint tracker does. The first two know both services; a player of HLS and one of the endless MP4 know one
  address, that of HAProxy. In brackets, how often they opened a stream again. The length of a GOP or segment,
  which arrives in one piece, is subtracted; the page's is the time for which its picture stood still;
* *numbers*: people whose number changed at one of the services, or differs between them;
* *lost*: GOPs that a service has shown and not recorded.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import sys
import tempfile
from collections.abc import AsyncIterator, Sequence
from pathlib import Path

from playwright.async_api import Browser

from benchmarks.common.browser import chromium, chromium_path
from benchmarks.common.environment import CannotRunError, parser
from benchmarks.common.report import Report
from benchmarks.faults.failover.failover_run import FailoverOutcome, check_recordings, run
from benchmarks.faults.failover.failover_table import describe
from benchmarks.faults.failover.failures import FAILURES, Failure
from benchmarks.faults.failover.two_services import run_two_services
from benchmarks.faults.video.stamped_views import StampedViews, make
from client import ClientError

_PULSES = 20_000
"""Pulses with detections: 13 minutes."""
_LINES = 20


@contextlib.asynccontextmanager
async def _browser() -> AsyncIterator[Browser | None]:
    """Run a browser, where there is one."""
    if chromium_path() is None:
        yield None
        return
    async with chromium() as browser:
        yield browser


async def measure(
    failures: Sequence[Failure], folder: Path, report: Report, *, page: bool = True
) -> list[FailoverOutcome]:
    """Run the failures one after the other, those of one kind of site in one site."""
    views = await asyncio.to_thread(make, folder, _PULSES)
    outcomes: list[FailoverOutcome] = []
    async with _browser() if page else contextlib.nullcontext() as browser:
        kinds = itertools.groupby(failures, key=lambda failure: (failure.cuts_off, failure.is_joint))
        for number, (_, group) in enumerate(kinds):
            some = list(group)
            own = folder / f"site-{number}"
            await asyncio.to_thread(own.mkdir)
            try:
                outcomes += await _run_group(some, own, views, browser)
            except CannotRunError as error:
                report.line(f"cut off: skipped: {error}")
            except (ClientError, RuntimeError) as error:
                report.line(f"{error}\n{await asyncio.to_thread(_last_lines, own / 'site.log')}")
                outcomes += [FailoverOutcome(failure, failed="the site did not run") for failure in some]
    return outcomes


async def _run_group(
    failures: Sequence[Failure], folder: Path, views: StampedViews, browser: Browser | None
) -> list[FailoverOutcome]:
    outcomes = []
    kind = failures[0]
    async with run_two_services(views, folder, cut_off=kind.cuts_off, joint=kind.is_joint) as site:
        for failure in failures:
            outcomes.append(await run(failure, site, views, browser))
            print(f"{failure.name}: done", file=sys.stderr, flush=True)
    await asyncio.to_thread(check_recordings, outcomes, site)
    return outcomes


def _last_lines(log: Path) -> str:
    text = log.read_text(encoding="utf-8", errors="replace") if log.exists() else ""
    return "\n".join(text.splitlines()[-_LINES:])


def main() -> None:
    """Read the command line, run, print."""
    options = parser(__doc__ or "", "faults.failover")
    names = [failure.name for failure in FAILURES]
    options.add_argument("--failure", action="append", choices=names, help="only this one; may be repeated")
    options.add_argument("--no-page", action="store_true", help="no browser")
    options.add_argument("--list", action="store_true", help="only list them")
    chosen = options.parse_args()
    if chosen.list:
        print("\n".join(names))
        return
    failures = [failure for failure in FAILURES if not chosen.failure or failure.name in chosen.failure]
    report = Report()
    with tempfile.TemporaryDirectory() as folder:
        outcomes = asyncio.run(measure(failures, Path(folder), report, page=not chosen.no_page))
    describe(report, outcomes)
    report.save(chosen.out / "failover.txt")


if __name__ == "__main__":
    main()
