# SPDX-License-Identifier: BSD-3-Clause
"""What memory the package's nodes take while the simulated chair drives and maps, and what MRPT's libraries take."""

from __future__ import annotations

import argparse
import re
import subprocess
import xmlrpc.client
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from kurumaisu import children
from kurumaisu.bench.processes import PATIENCE, master, program
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error

_CHAIR = ("sim.launch", "laser:=driver", "viewer:=true", "viewer_port:=0")
_KINDS = ("Rss", "Pss", "Private_Dirty")  # of /proc/PID/smaps_rollup


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="scripts/bench nodes", description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="of driving, after the first map")
    options = parser.parse_args(arguments)
    table = Table(
        "memory [MB]; Pss: what processes share is divided among them; private: written to, shared with nobody",
        *("process", "resident", "Pss", "private"),
    )
    with master() as environment, _launched(_CHAIR, environment):
        _listen(0.0, ("/scan", "/odom"), environment)
        with _launched(("slam.launch",), environment):
            _listen(options.seconds, ("/map", "/cmd_vel"), environment)
            for name, pid in sorted(_nodes(environment["ROS_MASTER_URI"]).items()):
                table.row(name, *_memory(pid))
    for name in ("laser_node", "mapping_node"):
        _idle(table, f"what {name} loads of MRPT, alone", _libraries(program(name)))
    _idle(table, "no library", [])
    return 0


@contextmanager
def _launched(words: Sequence[str], environment: Mapping[str, str]) -> Iterator[None]:
    line = ["roslaunch", "kurumaisu", *words]
    launch = children.start(line, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        children.interrupt(launch, PATIENCE)


def _listen(seconds: float, topics: Sequence[str], environment: Mapping[str, str]) -> None:
    """Hear topics for so long after the first message of each; a circle is driven on those that command."""
    line = [program("listener"), str(seconds), *topics]
    done = subprocess.run(line, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Error(f"{' '.join(line)}: heard nothing on some of them: {done.stdout}")


def _nodes(uri: str) -> dict[str, int]:
    """Return the processes of the package's nodes by their names; parts of one process have the name of the last."""
    caller = xmlrpc.client.ServerProxy(uri)
    state: Any = caller.getSystemState("/bench")
    names = {node for part in state[2] for _, nodes in part for node in nodes} - {"/rosout"}
    pids = {}
    for name in names:
        address: Any = caller.lookupNode("/bench", name)
        answer: Any = xmlrpc.client.ServerProxy(address[2]).getPid("/bench")
        pids[name.lstrip("/")] = int(answer[2])
    return pids


def _libraries(path: str) -> list[str]:
    """Return MRPT's libraries that a program loads."""
    said = subprocess.run(["ldd", path], capture_output=True, text=True, check=True).stdout
    return re.findall(r"=> (\S*/libmrpt-\S+)", said)


def _idle(table: Table, name: str, libraries: Sequence[str]) -> None:
    """Print what a process takes that does nothing but load libraries, of which it has said a byte that it runs."""
    line = ["env", f"LD_PRELOAD={':'.join(libraries)}", "tee"]
    with children.start(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(b"\n")
        process.stdin.flush()
        process.stdout.readline()
        table.row(name, *_memory(process.pid))
        process.stdin.close()


def _memory(pid: int) -> list[float]:
    """Return the kinds of memory [MB] of a process."""
    said = dict(re.findall(r"^(\w+): +(\d+) kB", Path(f"/proc/{pid}/smaps_rollup").read_text(), re.MULTILINE))
    return [int(said[kind]) * 1024 / 1e6 for kind in _KINDS]
