# SPDX-License-Identifier: BSD-3-Clause
"""Runs one benchmark by its name: scripts/bench NAME [OPTION]... [--write PAGE]. Without a name it lists them."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from kurumaisu.bench import page
from kurumaisu.bench.table import collected
from kurumaisu.errors import Error, failed
from kurumaisu.names import hint

MODULES = {
    "sim": "kurumaisu.bench.speed.sim",
    "pool": "kurumaisu.bench.speed.pool",
    "agreement": "kurumaisu.bench.accuracy.stage.main",
    "arena": "kurumaisu.bench.speed.arena",
    "stageros": "kurumaisu.bench.speed.stageros",
    "critic": "kurumaisu.bench.critic.main",
    "strangers": "kurumaisu.bench.critic.strangers",
    "critic_time": "kurumaisu.bench.critic.cost",
    "next_experiment": "kurumaisu.bench.critic.next_experiment",
    "experiments_doc": "kurumaisu.bench.experiments_doc",
    "sanity": "kurumaisu.bench.critic.sanity",
    "laser": "kurumaisu.bench.speed.laser",
    "laser_clock": "kurumaisu.bench.accuracy.laser_clock",
    "faults": "kurumaisu.bench.faults.laser.main",
    "fuzz": "kurumaisu.bench.faults.fuzz",
    "guard": "kurumaisu.bench.faults.guard.main",
    "mutations": "kurumaisu.bench.mutations",
    "base": "kurumaisu.bench.speed.base",
    "base_faults": "kurumaisu.bench.faults.base.main",
    "drive": "kurumaisu.bench.speed.drive",
    "odometry": "kurumaisu.bench.accuracy.odometry",
    "slam": "kurumaisu.bench.slam.main",
    "slam_localise": "kurumaisu.bench.slam.localise",
    "peers": "kurumaisu.bench.critic.peers",
    "predict": "kurumaisu.bench.critic.predict",
    "paper": "kurumaisu.bench.paper.drive",
    "paper_scans": "kurumaisu.bench.paper.scans",
    "paper_wall": "kurumaisu.bench.paper.wall",
    "viewer": "kurumaisu.bench.speed.viewer.main",
    "nodes": "kurumaisu.bench.speed.nodes",
    "wheel": "kurumaisu.bench.wheel",
}
_HELP = "\n  --write PAGE          put command and tables into the section of this benchmark in a page of docs/"


def main(arguments: Sequence[str]) -> int:
    """Run the benchmark that the first argument names, with the others. Return 2 if there is none of that name."""
    there = {name: module for name, module in MODULES.items() if importlib.util.find_spec(module)}
    if not arguments or arguments[0] in ("-h", "--help"):
        _list(there)
        return 0
    name, *others = arguments
    if name not in there:
        print(f"scripts/bench: no benchmark {name!r}; {hint(name, there, 'scripts/bench')}", file=sys.stderr)
        return 2
    try:
        path, own = _to_write(others)
        return _run(name, there[name], own, path)
    except Error as error:
        return failed("scripts/bench", error)


def _run(name: str, module: str, arguments: list[str], path: Path | None) -> int:
    """Run a benchmark; write its tables into a page if one is given, also where a bound is broken."""
    if path is not None:
        page.check(path, "bench", name)  # before hours of work
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # figures are of one core; --jobs uses others
    with collected() as tables:
        try:
            status: int = importlib.import_module(module).main(arguments)
        except SystemExit:
            if {"-h", "--help"} & set(arguments):
                print(_HELP)
            raise
    if path is not None:
        page.write(path, "bench", name, arguments, tables)
    return status


def _to_write(arguments: Sequence[str]) -> tuple[Path | None, list[str]]:
    """Return the page after --write, if there is one, and the arguments without it. Raise Error if it has none."""
    own = list(arguments)
    path = None
    for i, argument in enumerate(arguments):
        if argument == "--write":
            if i + 1 == len(arguments):
                raise Error("--write: wants a page of docs/")
            path, own = Path(arguments[i + 1]), [*arguments[:i], *arguments[i + 2 :]]
        elif argument.startswith("--write="):
            path, own = Path(argument.partition("=")[2]), [*arguments[:i], *arguments[i + 1 :]]
    return path, own


def _list(modules: dict[str, str]) -> None:
    """Print the benchmarks, each with the first line of its docstring; none is imported, which would take seconds."""
    print("scripts/bench NAME [OPTION]... [--write PAGE]; scripts/bench NAME --help says more\n")
    for name, module in modules.items():
        spec = importlib.util.find_spec(module)
        assert spec is not None
        assert spec.origin is not None
        text = ast.get_docstring(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))) or ""
        print(f"{name:<{max(map(len, modules))}}  {text.partition(chr(10))[0]}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
