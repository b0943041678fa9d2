# SPDX-License-Identifier: BSD-3-Clause
"""Rawlogs: rates from poses, and the way from MRPT's file to a recording."""

import gzip
import importlib.util
from pathlib import Path

import numpy as np
import pytest

from kurumaisu.critic.data.odometry import rates_between
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.errors import Error

DATASETS = Path("/usr/share/mrpt/datasets")


def test_rates_are_those_of_the_arc_driven():
    t = np.array([0.0, 0.1, 0.3, 0.4])
    v, w = 0.7, -2.5
    odom = np.column_stack([v / w * np.sin(w * t), v / w * (1 - np.cos(w * t)), w * t])
    v_w = rates_between(t, odom)
    np.testing.assert_allclose(v_w, np.tile([v, w], (4, 1)), rtol=1e-12)


@pytest.mark.skipif(importlib.util.find_spec("kurumaisu._slam") is None, reason="built without kurumaisu._slam")
def test_a_real_rawlog_is_read(tmp_path):
    path = DATASETS / "localization_demo.rawlog"
    if not path.exists():
        pytest.skip(f"needs {path}, of Debian's mrpt-common")
    recording = read_recording(path)
    (run,) = recording.runs
    assert recording.laser.beams == run.scan.values.shape[1]
    assert (np.diff(run.scan.t) > 0).all()
    assert np.isfinite(run.odom.values).all()
    (tmp_path / "cut.rawlog").write_bytes(b"no rawlog")
    with pytest.raises(Error, match=r"cut\.rawlog"):
        read_recording(tmp_path / "cut.rawlog")


@pytest.mark.skipif(importlib.util.find_spec("kurumaisu._slam") is None, reason="built without kurumaisu._slam")
def test_a_packed_rawlog_is_unpacked_to_a_limit(tmp_path):
    path = tmp_path / "bomb.rawlog.gz"
    path.write_bytes(gzip.compress(bytes(200_000_000)))
    with pytest.raises(Error, match=r"bomb\.rawlog\.gz: has more than \d+ bytes unpacked"):
        read_recording(path)
