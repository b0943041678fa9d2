# SPDX-License-Identifier: BSD-3-Clause
"""Our mapper over a log in a process of its own, so that its processor time and memory are told as a peer's are."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kurumaisu import slam
from kurumaisu.bench.peers import Run, read_run
from kurumaisu.errors import Error
from kurumaisu.maps import Grid
from kurumaisu.params import shipped
from kurumaisu.slam import ScanLog
from kurumaisu.types import FloatArray


def ours(log: ScanLog, seed: int, folder: Path) -> tuple[Run, FloatArray, Grid]:
    """Map a log with the shipped settings. Return costs, poses (n, 3) at all scans, and the map."""
    given, taken = folder / "log.npz", folder / "mapped.npz"
    fan = log.fan
    numbers = [fan.angle_min, fan.angle_increment, fan.time_increment, fan.range_max, *fan.base_from_laser]
    np.savez(given, times=log.times, ranges=log.ranges, odom=log.odom, odom_end=log.odom_end, fan=np.array(numbers))
    command = [sys.executable, "-m", "kurumaisu.bench.slam.ours", str(given), str(taken), str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Error(f"the mapper: returned {done.returncode}: {done.stderr[-1000:]}")
    with np.load(taken) as mapped:
        resolution, x, y = mapped["grid"]
        grid = Grid(mapped["cells"], float(resolution), float(x), float(y))
        return read_run(done.stdout), mapped["poses"], grid


def main(arguments: Sequence[str]) -> int:
    """Map a log file into another with a seed and print the costs, the log's own memory left out."""
    given, taken, seed = arguments
    with np.load(given) as kept:
        arrays = {name: kept[name] for name in kept.files}
    numbers = arrays.pop("fan").tolist()
    names = ("angle_min", "angle_increment", "time_increment", "range_max")
    fan = slam.Fan(**dict(zip(names, numbers, strict=False)), base_from_laser=numbers[4:])
    log = ScanLog(name=Path(given).stem, fan=fan, **arrays)
    settings = slam.load_mapping_settings(shipped("launch/mapping_node.yaml"))
    start = time.process_time()
    result = slam.map_scans(settings, log, int(seed))
    cpu = time.process_time() - start
    peak = _peak_memory() - sum(array.nbytes for array in arrays.values()) / 2**20
    grid = result.grid
    np.savez(taken, poses=result.trajectory[:, 1:], cells=grid.cells, grid=[grid.resolution, grid.x, grid.y])
    print(f"load 0\ncpu {cpu:.6f}\nmemory {peak:.3f}")
    return 0


def _peak_memory() -> float:
    """Return this process's [MiB]; getrusage's takes over the peak of the process that started this one."""
    status = Path("/proc/self/status").read_text(encoding="ascii").split()
    return float(status[status.index("VmHWM:") + 1]) / 1024


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
