"""Fuzzing of everything that reads bytes from outside.

    python -m benchmarks.fuzz --part mot
    python -m benchmarks.fuzz --target bus-sessions --first 5000 --inputs 5000
    python -m benchmarks.fuzz --replay out/fuzz/mot-text.ValueError-read_rows.1.bin

An invalid input must be refused with a one-line error, or counted and dropped. Anything else is a crash:
another exception, a traceback in a response or in the log, status 500, two seconds of processor time, 200 MB
more memory, or the death of the process. Inputs are reproducible from their number and --seed. An input may
be a script of many messages, which are all counted.
"""

from __future__ import annotations

import argparse
import importlib
import multiprocessing
import os
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from benchmarks.common.environment import ROOT
from benchmarks.common.report import Report
from benchmarks.fuzz.engine.runner import Crash, FuzzPlan, InputFeeder, TargetResult, TargetRunner
from benchmarks.fuzz.engine.target import Target

PARTS = {
    "pulse": "pulses.targets",
    "bus": "bus.messages",
    "http": "http.targets",
    "config": "files.config",
    "mot": "files.motchallenge",
    "calibration": "files.calibration",
    "media": "media.targets",
    "recordings": "files.recordings",
}
"""The module that lists the targets of each part."""
MESSAGES = 1_000_000
_COLUMNS = ("target", "inputs", "messages", "per second", "refused", "accepted", "crashes", "kinds of crash")


def targets_of(part: str) -> tuple[type[Target], ...]:
    """Import and return the targets of a part."""
    found: tuple[type[Target], ...] = importlib.import_module(f"benchmarks.fuzz.{PARTS[part]}").TARGETS
    return found


def run_parallel(
    targets: Sequence[type[Target]], plan: FuzzPlan, jobs: int
) -> Iterator[tuple[int, TargetResult]]:
    """Run targets in `jobs` processes; yield the index and result of each as it ends."""
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("fork")) as pool:
        running = {pool.submit(_run, target, plan): place for place, target in enumerate(targets)}
        for done in as_completed(running):
            yield running[done], done.result()


def _run(target: type[Target], plan: FuzzPlan) -> TargetResult:
    return TargetRunner(target, target.name, plan).run()


def replay(path: Path) -> int:
    """Feed a saved input again; return 1 if it still crashes."""
    name = path.name.split(".")[0]
    part = name.split("-", maxsplit=1)[0]
    target_type = (
        next((target for target in targets_of(part) if target.name == name), None) if part in PARTS else None
    )
    if target_type is None:
        sys.exit(f"{path}: not a saved input; their names are TARGET.KIND.NUMBER.bin")
    target = target_type()
    feeder = InputFeeder(target)
    with feeder.watching():
        found = feeder.feed(path.read_bytes())
    target.close()
    if isinstance(found, Crash):
        print(found.text)
        return 1
    print(f"{path}: {'accepted' if found else 'refused'}, as it should be")
    return 0


def row(name: str, result: TargetResult) -> list[str]:
    """Return a row of the table."""
    counts, rate = result.counts, result.counts.messages / result.seconds if result.seconds else 0.0
    numbers = (counts.inputs, counts.messages, round(rate), counts.refused, counts.accepted, counts.crashes)
    return [name, *map(str, numbers), str(result.kinds)]


def main() -> None:
    """Fuzz, print the table, and exit with 1 if anything crashed."""
    options = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=__doc__.splitlines()[0])
    options.add_argument("--part", action="append", choices=PARTS, help="only this one; may be repeated")
    options.add_argument("--target", action="append", help="only this one of a part; may be repeated")
    options.add_argument("--messages", type=int, help=f"per target; {MESSAGES} by default")
    options.add_argument("--inputs", type=int, help="per target, regardless of messages")
    options.add_argument("--first", type=int, default=0, help="the number of the first input")
    options.add_argument("--seconds", type=float, help="maximum per target")
    options.add_argument(
        "--jobs", type=int, default=len(os.sched_getaffinity(0)), help="number of parallel targets"
    )
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--out", type=Path, default=ROOT / "out" / "fuzz", help="folder for crashing inputs")
    options.add_argument("--replay", type=Path, metavar="FILE", help="only feed this saved input")
    chosen = options.parse_args()
    if chosen.replay is not None:
        sys.exit(replay(chosen.replay))
    report = Report()
    targets = [
        target
        for part in chosen.part or PARTS
        for target in targets_of(part)
        if not chosen.target or target.name in chosen.target
    ]
    if not targets:
        options.error("no target of these parts has this name")
    plan = FuzzPlan(
        inputs=chosen.inputs,
        seconds=chosen.seconds,
        seed=chosen.seed,
        out=chosen.out,
        messages=MESSAGES if chosen.inputs is None and chosen.messages is None else chosen.messages,
        first=chosen.first,
    )
    results: dict[int, TargetResult] = {}
    for place, result in run_parallel(targets, plan, max(1, chosen.jobs)):
        results[place] = result
        print("  ".join(row(targets[place].name, result)), file=sys.stderr, flush=True)
    rows = [row(target.name, results[place]) for place, target in enumerate(targets)]
    report.table("Fuzzing", _COLUMNS, rows)
    suffix = [str(chosen.first)] if chosen.first else []
    report.save(chosen.out / f"fuzz-{'-'.join([*(chosen.target or chosen.part or ['all']), *suffix])}.txt")
    sys.exit(any(result.counts.crashes for result in results.values()))


if __name__ == "__main__":
    main()
