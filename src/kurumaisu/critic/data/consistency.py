# SPDX-License-Identifier: BSD-3-Clause
"""Do the parts of a run belong together? What can be said without a model."""

from __future__ import annotations

import numpy as np

from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.values.recording import LONGEST_HOLD, LaserMount, Run, Series
from kurumaisu.errors import Error

# No laser of this kind sees further: ranges whose median is above it are millimetres.
FARTHEST_MEDIAN = 100.0


def usable(run: Run) -> bool:
    """Tell whether a run says something about base or laser."""
    driven = run.command is not None or run.voltage is not None
    measured = run.pose is not None or run.imu is not None
    followed = measured or run.odom is not None or run.queries is not None
    return run.scan is not None or (driven and followed) or (run.odom is not None and measured)


def check_run(run: Run, laser: LaserMount | None, faults: Faults) -> None:
    """Report parts that do not fit together. Raise Error for scans that are not of the laser of meta.yaml."""
    _check_overlap(run, faults)
    if run.scan is not None:
        _check_scan(run, run.scan, laser, faults)


def _check_overlap(run: Run, faults: Faults) -> None:
    spans: dict[str, tuple[float, float]] = {}
    for name in ("command", "voltage", "pose", "odom", "scan"):
        part: Series | None = getattr(run, name)
        if part is not None:
            hold = LONGEST_HOLD if name in ("command", "voltage") else 0.0
            spans[name] = float(part.t[0]), float(part.t[-1]) + hold
    names = list(spans)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            if spans[a][0] > spans[b][1] or spans[b][0] > spans[a][1]:
                told = f"{a} ({_span(run, a)}) and {b} ({_span(run, b)})"
                faults.add(f"{run.name}: {told} were not recorded at the same time", fatal=True)


def _span(run: Run, name: str) -> str:
    t = getattr(run, name).t
    return f"{t[0]:.6g} to {t[-1]:.6g} s"


def _check_scan(run: Run, scan: Series, laser: LaserMount | None, faults: Faults) -> None:
    beams = scan.values.shape[1]
    if laser is not None and beams != laser.beams:
        raise Error(f"{run.name}: scans have {beams} beams, but meta.yaml says laser.beams: {laser.beams}")
    finite = scan.values[np.isfinite(scan.values)]
    if len(finite) and np.median(finite) > FARTHEST_MEDIAN:
        faults.add(f"{run.name}: ranges around {np.median(finite):.4g}: millimetres, not metres?", fatal=True)
    if laser is None or run.fan is None:
        return
    first = run.fan.angle_min - laser.angle_min
    last = first + (run.fan.angle_increment - laser.angle_increment) * (beams - 1)
    if max(abs(first), abs(last)) > abs(laser.angle_increment) / 4:
        faults.add(
            f"{run.name}: angles of the scans differ from those of meta.yaml by {first:.2g} rad at the first beam "
            f"and {last:.2g} rad at the last"
        )
