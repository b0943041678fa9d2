# SPDX-License-Identifier: BSD-3-Clause
"""A URG-04LX carried by hand through a building: scans, and nothing that says where it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kurumaisu.critic.data.reading import read_recording
from kurumaisu.real.criticise import criticise, there


def run(data: Path, output: Path) -> None:
    """Print what can be said of the scans."""
    bag = there(data / "scan_tools/demo.bag")
    scan = read_recording(bag).runs[0].scan
    assert scan is not None
    print("## By hand")
    change = np.nanmedian(np.abs(np.diff(scan.values, axis=0)), axis=1)
    print(f"{len(scan.t)} scans of {scan.values.shape[1]} beams in {scan.t[-1] - scan.t[0]:.1f} s")
    print(f"{np.isnan(scan.values).mean():.1%} of the readings are invalid")
    print(f"from scan to scan the median beam changes by {1e3 * np.median(change):.0f} mm: it is carried about")
    print(f"stillest second: {1e3 * np.convolve(change, np.ones(10) / 10, 'valid').min():.1f} mm from scan to scan")
    criticise(bag, output, "scans alone, moving")
