"""Run the whole suite part by part, and print one summary: ``make test``.

All parts run, even after failures. The last line has the format of pytest. ``--runs 20 --at-once 2`` runs
everything twenty times, two runs in parallel: `make test-loaded` checks that no test fails under load.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path
from xml.etree import ElementTree as ET

ROOT = Path(__file__).resolve().parents[1]
_NODE = Path(sys.executable).parent / "node"
_TSC = ROOT / "node_modules/typescript/bin/tsc"
_FETCHED = ROOT / "node_modules/.installed"
"""Exists if npm has installed the compiler."""
_FAST = ("-m", "not slow", "-n", "5", "--dist", "loadfile", "--no-loadscope-reorder")
"""Five workers for two processors, since sites and browsers wait for frames part of the time."""
_SLOW = ("-m", "slow", "--timeout", "1800")
_OTHER_EXAMPLES = ("-m", "hypothesis and not slow", "-n", "3", "--hypothesis-profile", "new examples")
_NO_TESTS = 5
"""Exit code of pytest without tests."""
_INTERRUPTED = 130


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a part: numbers of passed, failed and skipped tests."""

    name: str
    seconds: float = 0.0
    passed: int = 0
    failed: int = 0
    skipped: Counter[str] = field(default_factory=Counter)
    """Number of skipped tests by reason."""
    not_run: str | None = None
    """Why the part could not run; None if it ran."""


def main() -> None:
    """Run the suite; exit with 1 if anything failed."""
    options = _arguments()
    if options.runs > 1:
        command = [sys.executable, __file__, *["--slow"] * options.slow]
        command += [] if options.may_skip is None else ["--may-skip", options.may_skip]
        sys.exit(not run_often(command, options.runs, options.at_once))
    outcomes = run_slow(options.may_skip) if options.slow else run_fast(options.may_skip)
    _print_table(outcomes)
    print("", closing_line(outcomes), sep="\n", flush=True)
    sys.exit(any(outcome.failed for outcome in outcomes))


def run_often(command: Sequence[str], runs: int, at_once: int) -> bool:
    """Run a command several times, some in parallel; return whether none failed.

    Prints the whole output of failed runs, and the last line of others.
    """
    closing, failed = [], 0
    with ThreadPoolExecutor(at_once) as pool:
        waiting = [
            pool.submit(subprocess.run, command, capture_output=True, text=True, check=False)
            for _ in range(runs)
        ]
        for number, run in enumerate((future.result() for future in as_completed(waiting)), 1):
            lines = run.stdout.rstrip().splitlines() or [f"exit code {run.returncode}"]
            closing.append(lines[-1])
            failed += run.returncode != 0
            print(f"run {number} of {runs} ended at a load of {os.getloadavg()[0]:.0f}")
            print(run.stdout + run.stderr if run.returncode else lines[-1], flush=True)
    print("", *closing, f"{runs - failed} of {runs} runs without a failure", sep="\n", flush=True)
    return not failed


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--slow", action="store_true", help="run only the tests that take minutes")
    parser.add_argument("--runs", type=int, default=1, metavar="N", help="run everything N times")
    parser.add_argument("--at-once", type=int, default=1, metavar="N", help="number of parallel runs")
    parser.add_argument(
        "--may-skip", metavar="WORD", help="count tests skipped for any other reason as failed"
    )
    return parser.parse_args()


def run_fast(may_skip: str | None = None) -> list[Outcome]:
    """Run everything except the tests that take minutes."""
    return [
        check_page_types(may_be_skipped=may_skip is None),
        run_pytest("tests", _FAST, may_skip),
    ]


def run_slow(may_skip: str | None = None) -> list[Outcome]:
    """Run the tests that take minutes, and the property tests with new examples."""
    return [
        run_pytest("slow tests", _SLOW, may_skip),
        run_pytest("property tests, other examples", _OTHER_EXAMPLES, may_skip),
    ]


def check_page_types(*, may_be_skipped: bool) -> Outcome:
    """Check the types of the page's JavaScript, if npm could install the compiler."""
    name = "types of the page"
    if not _FETCHED.exists():
        why = "npm could not fetch the TypeScript compiler; see `make node_modules`"
        return Outcome(name, not_run=why, failed=not may_be_skipped)
    began = time.monotonic()
    code = subprocess.run([_NODE, _TSC], cwd=ROOT, check=False).returncode
    return Outcome(name, time.monotonic() - began, passed=code == 0, failed=code != 0)


def run_pytest(
    name: str, arguments: Sequence[str], may_skip: str | None = None, folder: Path = ROOT
) -> Outcome:
    """Run pytest in a subprocess, and count the results; a crashed run counts as a failure."""
    print(f"\n{name}", flush=True)
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="myview-suite-") as reports:
        report = Path(reports) / "report.xml"
        command = [
            sys.executable,
            "-m",
            "pytest",
            "--continue-on-collection-errors",
            *arguments,
            f"--junit-xml={report}",
            "-o",
            "junit_logging=no",
        ]
        try:
            code = subprocess.run(command, cwd=folder, check=False).returncode
        except KeyboardInterrupt:
            sys.exit(_INTERRUPTED)
        reported = report.exists()
        cases = list(ET.parse(report).iter("testcase")) if reported else []  # noqa: S314 — our own
    failed = sum(case.find("failure") is not None or case.find("error") is not None for case in cases)
    skipped = Counter(element.get("message", "") for case in cases for element in case.iter("skipped"))
    refused = {
        reason: count for reason, count in skipped.items() if may_skip is not None and may_skip not in reason
    }
    for reason, count in refused.items():
        print(f"{count} skipped that must not be: {reason}")
    passed = len(cases) - failed - skipped.total()
    if not reported or code not in {0, 1, _NO_TESTS} or (code == 1 and not failed):
        print(f"pytest ended with exit code {code}")
        failed += 1
    return Outcome(
        name,
        time.monotonic() - began,
        passed=max(passed, 0),
        failed=failed + sum(refused.values()),
        skipped=skipped - Counter(refused),
    )


def closing_line(outcomes: Sequence[Outcome]) -> str:
    """Return the sum of all parts in pytest's format: ``= 1 failed, 3 passed in 259.15s (0:04:19) =``."""
    failed = sum(outcome.failed for outcome in outcomes)
    skipped = sum(outcome.skipped.total() for outcome in outcomes)
    counts = [f"{sum(outcome.passed for outcome in outcomes)} passed"]
    counts = [f"{failed} failed"] * (failed > 0) + counts + [f"{skipped} skipped"] * (skipped > 0)
    seconds = sum(outcome.seconds for outcome in outcomes)
    return f" {', '.join(counts)} in {seconds:.2f}s ({timedelta(seconds=int(seconds))}) ".center(80, "=")


def _print_table(outcomes: Sequence[Outcome]) -> None:
    print(f"\n{'part':<28}{'passed':>8}{'failed':>8}{'skipped':>9}{'time':>10}")
    for outcome in outcomes:
        if outcome.not_run is not None:
            print(f"{outcome.name:<28}not run: {outcome.not_run}")
            continue
        time_taken = str(timedelta(seconds=int(outcome.seconds)))
        print(
            f"{outcome.name:<28}{outcome.passed:>8}{outcome.failed:>8}{outcome.skipped.total():>9}{time_taken:>10}"
        )


if __name__ == "__main__":
    main()
