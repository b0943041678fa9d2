# SPDX-License-Identifier: BSD-3-Clause
"""A real URG-04LX on a bench: how it repeats itself, how its neighbours agree, how its clock runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kurumaisu.real import urg_log
from kurumaisu.real.by_hand import least_squares
from kurumaisu.real.criticise import criticise, recording, there
from kurumaisu.types import FloatArray

STILL = 34  # scans before somebody moves the sensor
_STEADY = 0.02  # [m] sd of a beam beyond which it sits on an edge
INCREMENT = 2 * np.pi / 1024
ANGLE_MIN = (46 - 384) * INCREMENT  # [rad] step 384 looks ahead


def run(data: Path, output: Path) -> None:
    """Print what can be said of the sensor."""
    log = urg_log.load(there(data / "player_urg04lx/hokuyo_aist.logr"))
    print("## By hand")
    print(f"{len(log.host)} scans of {log.readings.shape[1]} beams; codes {sorted(log.codes)}")
    print(f"{np.isnan(log.readings).mean():.1%} of the readings are error codes")
    device = np.unwrap(log.device, period=64**4 * 1e-3)
    since = log.host - log.host[0]
    behind = since - (device - device[0])
    step = np.zeros(len(since))
    step[int(np.argmax(np.abs(np.diff(behind)))) + 1 :] = 1.0  # once, a request of the host's came out of step
    line = least_squares(np.column_stack([since, np.ones(len(since)), step]), device - device[0])
    print(
        f"device clock over host clock: {line.at[0] - 1:+.3%} +- {line.sd[0]:.3%} (scatter {1e3 * line.rms:.1f} ms), "
        f"beside a step of {1e3 * line.at[2]:+.0f} ms after scan {int(np.argmax(step))}"
    )
    print(f"longest gap between scans: {np.diff(log.host).max():.2f} s; median {np.median(np.diff(log.host)):.3f} s")
    for told in repeatability(log.readings[:STILL]):
        print(told)
    scan = np.column_stack([since[:STILL], log.readings[:STILL]])
    mount = {
        "x": 0.0,
        "y": 0.0,
        "yaw": 0.0,
        "angle_min": ANGLE_MIN,
        "angle_increment": INCREMENT,
        "beams": scan.shape[1] - 1,
    }
    criticise(recording(output / "still", {"still": {"scan": scan}}, laser=mount), output, "scans of a still scene")


def repeatability(readings: FloatArray) -> list[str]:
    """Return in words how scans (n, b) [m] of a still scene scatter: by distance, and from beam to beam."""
    whole = np.isfinite(readings).all(axis=0)
    middle, sd = np.full(readings.shape[1], np.nan), np.full(readings.shape[1], np.nan)
    middle[whole], sd[whole] = readings[:, whole].mean(axis=0), readings[:, whole].std(axis=0, ddof=1)
    steady = whole & (sd < _STEADY)
    told = []
    for low, high in ((0.0, 0.75), (0.75, 1.5), (1.5, 2.0), (2.0, 2.5)):
        some = steady & (middle >= low) & (middle < high)
        if some.any():
            told.append(f"{low:g}-{high:g} m: sd {1e3 * np.median(sd[some]):.1f} mm (median of {some.sum()} beams)")
    unit = np.where(steady, (readings - middle) / np.where(sd > 0, sd, 1.0), np.nan)
    lags = {k: float(np.nanmean(unit[:, k:] * unit[:, :-k])) for k in (1, 2, 3, 5)}
    plain = ", ".join(f"{lags[k]:.2f}" for k in lags)
    unit -= np.nanmean(unit, axis=1, keepdims=True)
    unit /= np.sqrt(np.nanmean(unit[:, steady] ** 2))
    freed = ", ".join(f"{float(np.nanmean(unit[:, k:] * unit[:, :-k])):.2f}" for k in lags)
    told.append(f"neighbours correlate at lags 1, 2, 3, 5: {plain}; without each scan's mean: {freed}")
    count = int(np.isfinite(unit[:, 1:] * unit[:, :-1]).sum())
    told.append(f"(over {count} pairs; independent ones would scatter by {1 / np.sqrt(count):.3f})")
    return told
