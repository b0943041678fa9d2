# SPDX-License-Identifier: BSD-3-Clause
"""critic RECORDING...: say what a model gets wrong about a measured robot."""

from __future__ import annotations

import argparse
import io
import os
import shutil
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from kurumaisu.critic.app import batch, cli, results
from kurumaisu.critic.app.display import Display, display
from kurumaisu.critic.app.job import ERROR, Job, Outcome, run
from kurumaisu.critic.app.options import parse
from kurumaisu.critic.bags.containers import SUFFIXES, is_bag
from kurumaisu.critic.data.csv_reader import is_csv_run
from kurumaisu.critic.data.excerpt import Excerpt
from kurumaisu.critic.data.reading import META, is_log
from kurumaisu.critic.values.selection import effect_ids
from kurumaisu.critic.values.verdict import Verdict
from kurumaisu.errors import Error, one_line

INTERRUPTED = 130  # 128 + SIGINT, as a shell has it
_BROKEN_PIPE = 141  # 128 + SIGPIPE


def main(arguments: Sequence[str] | None = None) -> int:
    """Criticise recordings; return the exit code, which critic --help explains."""
    options = parse(arguments)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without a minus sign must not cost the verdict
    try:
        code = _criticise(options)
        sys.stdout.flush()
        return code
    except Error as error:
        print(f"critic: {one_line(error)}", file=sys.stderr)
        return ERROR
    except KeyboardInterrupt:
        print("critic: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # who listened has heard enough; nor must Python complain when it flushes at its end
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _BROKEN_PIPE


def tell(job: Job) -> Verdict:
    """Criticise one recording, showing progress, print the answer and return it. Raise Error where there is none."""
    shown = display(sys.stderr, 1, quiet=False)
    (outcome,) = _here(job, shown)
    shown.close()
    if outcome.verdict is None:
        raise Error(outcome.error)
    _print([outcome], many=False)
    return outcome.verdict


def _criticise(options: argparse.Namespace) -> int:
    """Do it all. Raise Error for what is wrong before a recording is read."""
    jobs = _jobs(options)
    _check_places(options.output, options.table)
    shown = display(sys.stderr, len(jobs), quiet=options.quiet)
    done: dict[str, Outcome] = {}
    try:
        _run(jobs, options, shown, done)
    finally:
        shown.close()
        outcomes = [done[job.name] for job in jobs if job.name in done]
        if options.table:
            results.write_table(options.table, outcomes)
    if not options.json:
        _print(outcomes, many=len(jobs) > 1)
    return exit_code(outcomes)


def _run(jobs: list[Job], options: argparse.Namespace, shown: Display, done: dict[str, Outcome]) -> None:
    """Fill in outcomes by name as they come; print JSON in the order of the jobs, as soon as all before are there."""
    alone = len(jobs) == 1
    printed = 0
    for outcome in _outcomes(jobs, options, shown):
        done[outcome.job.name] = outcome
        _complain(outcome, shown, many=not alone)
        while options.json and printed < len(jobs) and jobs[printed].name in done:
            ready = done[jobs[printed].name]
            printed += 1
            if not (alone and ready.verdict is None):
                shown.close()
                print(results.as_json(ready, alone=alone), flush=True)


def _jobs(options: argparse.Namespace) -> list[Job]:
    found = cli.recordings(options.recordings, options.output)
    if not found:
        raise Error(f"{options.recordings[0]}: contains no recording")
    ids = effect_ids(options.only, options.without)
    excerpt = Excerpt(options.start, options.stop, tuple(options.without_rows))
    slam = not options.no_slam
    robot = options.robot
    asked = Job(Path(), Path(), "", options.model, options.runs, ids, options.seed, slam, excerpt, robot)
    if len(found) == 1:
        return [replace(asked, recording=found[0], output=options.output, name=found[0].name)]
    return [
        replace(asked, recording=path, output=options.output / name, name=name)
        for path, name in zip(found, cli.names(found), strict=True)
    ]


def _check_places(output: Path, table: Path | None) -> None:
    """Raise Error for what could not be written after hours of work."""
    if output.exists() and not output.is_dir():
        raise Error(f"--output: {output}: is a file, not a folder")
    if table is not None and (table.is_dir() or not table.absolute().parent.is_dir()):
        raise Error(f"--table: {table}: {'is a folder' if table.is_dir() else 'there is no such folder'}")


def _outcomes(jobs: list[Job], options: argparse.Namespace, shown: Display) -> Iterator[Outcome]:
    if options.dask:
        return batch.on_dask(jobs, options.dask, shown)
    return batch.on_processes(jobs, options.jobs, shown) if len(jobs) > 1 else _here(jobs[0], shown)


def _here(only: Job, shown: Display) -> Iterator[Outcome]:
    """Yield the outcome of a single job, run in this process."""
    shown.start(only.name)
    outcome = run(only, lambda message: shown.tell(only.name, message))
    shown.end(outcome)
    yield outcome


def _complain(outcome: Outcome, shown: Display, *, many: bool) -> None:
    """Say on the standard error what went wrong."""
    if outcome.error:
        shown.close()
        print(outcome.trace, end="", file=sys.stderr)
        print(f"critic: {f'{outcome.job.name}: ' if many else ''}{outcome.error}", file=sys.stderr, flush=True)


def _print(outcomes: Sequence[Outcome], *, many: bool) -> None:
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else 10_000
    if many:
        print(results.table(outcomes, width))
        return
    for outcome in outcomes:
        if outcome.verdict is not None:
            print(results.summary(outcome, width))
            print(f"report: {outcome.job.output / 'report.html'}")


def exit_code(outcomes: Sequence[Outcome]) -> int:
    """Return 1 when any failed, else the largest."""
    codes = [outcome.code for outcome in outcomes]
    return ERROR if ERROR in codes else max(codes)


def recordings(paths: Sequence[Path], output: Path) -> list[Path]:
    """Return the recordings among paths; a folder of recordings stands for all in it, without the output folder.

    Raise Error for one that is meant twice. What cannot be read is found out later, when it is read.
    """
    found = [item for path in paths for item in _inside(path, output)]
    twice = [item for item, count in Counter(item.resolve() for item in found).items() if count > 1]
    if twice:
        raise Error(f"{twice[0]}: is given twice")
    return found


def names(found: Sequence[Path]) -> list[str]:
    """Return a name for each of several recordings, all different: its path below the folder that all share."""
    whole = [item.resolve() for item in found]
    shared = Path(os.path.commonpath([item.parent for item in whole]))
    below = [item.relative_to(shared) for item in whole]
    short = [str(item if full.is_dir() else _bare(item)) for item, full in zip(below, whole, strict=True)]
    count = Counter(short)
    return [name if count[name] == 1 else str(item) for name, item in zip(short, below, strict=True)]


def _bare(path: Path) -> Path:
    while path.suffix in (*SUFFIXES, ".rawlog", ".gz", ".clf", ".log"):
        path = path.with_suffix("")
    return path


def _inside(path: Path, output: Path) -> list[Path]:
    """Return the recordings of a folder that is no recording itself, else the path."""
    if not path.is_dir() or is_bag(path) or (path / META).is_file():
        return [path]
    items = [item for item in sorted(path.iterdir()) if not item.name.startswith(".")]
    folders = [item for item in items if item.is_dir() and item.resolve() != output.resolve()]
    if not any(_is_recording(folder) for folder in folders):
        return [path]
    return sorted([*folders, *(item for item in items if item.is_file() and (is_bag(item) or is_log(item)))])


def _is_recording(folder: Path) -> bool:
    """Tell whether a folder is a recording of its own, rather than a run of the recording above it."""
    if (folder / META).is_file():
        return True
    if is_bag(folder):
        return False
    inside = sorted(folder.iterdir())
    runs = any(is_bag(item) or is_log(item) or (item.is_dir() and is_csv_run(item)) for item in inside)
    return runs and not is_csv_run(folder)
