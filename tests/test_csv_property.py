# SPDX-License-Identifier: BSD-3-Clause
"""Properties of the CSV reader: any numbers survive, and no text brings anything but a run or an Error."""

import tempfile
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.errors import Error

NUMBER = st.floats(-0.99e12, 0.99e12)
TIME = st.floats(0.0, 86_000.0)
ROWS = st.lists(st.tuples(TIME, NUMBER, NUMBER), min_size=1, max_size=20, unique_by=lambda row: row[0])
TEXT = st.text(alphabet=st.sampled_from('0123456789.,-+enaift \n\r"#\tx,,\n\n'), max_size=200)


@settings(max_examples=60)
@given(ROWS)
def test_any_numbers_of_sane_size_survive(rows):
    table = np.array(sorted(rows))
    voltage = Series(table[:, 0], table[:, 1:], ("v_f", "v_s"))
    scan = Series(table[:, 0], np.abs(table[:, 1:]) + 1e-3, ("r0", "r1"))
    with tempfile.TemporaryDirectory() as folder:
        write_csv_run(Path(folder), Run("r", voltage=voltage, scan=scan))
        (run,) = read_recording(Path(folder)).runs
    for part, back in ((voltage, run.voltage), (scan, run.scan)):
        np.testing.assert_array_equal(part.t, back.t)
        np.testing.assert_array_equal(part.values, back.values)


@settings(max_examples=200)
@given(st.sampled_from(["t,r0,r1\n", "t,x,y,theta\n", "t,tyre\n", ""]), TEXT)
def test_any_text_is_read_or_refused_with_the_file_named(header, text):
    with tempfile.TemporaryDirectory() as folder:
        for name in ("scan", "pose", "covariate"):
            (Path(folder) / f"{name}.csv").write_text(header + text, newline="")
        try:
            recording = read_recording(Path(folder))
        except Error as error:
            message = str(error)
        else:
            message = folder
            assert all((np.diff(run.scan.t) > 0).all() for run in recording.runs if run.scan is not None)
    assert folder in message
