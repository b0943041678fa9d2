# SPDX-License-Identifier: BSD-3-Clause
"""The riddles' laboratories measure what the paper's would, and rival answers look alike there."""

import numpy as np
import pytest

from kurumaisu.riddles import equation2, figure9, lab, offset
from kurumaisu.riddles.__main__ import main


def lines(riddle, count):
    """Return the first lines of a riddle; what the critic says later is not asked for."""
    story = riddle.tell(1000)
    return [next(story) for _ in range(count)]


def test_figure_9_comes_out_alike_by_range_and_by_incidence():
    told = lines(figure9, 6)
    by_range, by_incidence = ([float(word) for word in line.split()[-5:]] for line in told[4:6])
    # Equation (4) by hand at normal incidence; near by, the board's edges are farther away.
    printed = [1e3 * (0.002334 - 0.000488 * r + 0.000199 * r**2) for r in (1.0, 2.0, 3.9)]
    np.testing.assert_allclose(by_range[2:], np.hypot(printed, 0.29), atol=0.15)  # 1 mm steps add 0.29 mm
    np.testing.assert_allclose(by_incidence, by_range, atol=0.2)
    assert by_incidence[0] > by_incidence[2]  # rises towards near walls, though its law of range does not


def test_the_offset_reads_the_same_as_datum_and_as_sensor():
    told = lines(offset, 5)
    for line in told[3:5]:
        slope, millimetres = float(line.split()[-4]), float(line.split()[-2])
        assert slope == pytest.approx(1.004587, abs=0.002)
        assert millimetres == pytest.approx(59, abs=3)


def test_middle_beams_keep_their_bearings():
    chair = lab.chair()
    recording = lab.measured(chair, "wall_five_distances", chair.laser, 1000)
    narrow = lab.middle(recording, 0.1)
    assert narrow.laser.beams == narrow.runs[0].scan.values.shape[1] == 33  # 0.2 rad over 2 pi / 1024, both ends
    first = round((narrow.laser.angle_min - chair.laser.angle_min) / chair.laser.angle_increment)
    np.testing.assert_array_equal(narrow.runs[2].scan.values, recording.runs[2].scan.values[:, first : first + 33])


def test_the_published_law_jumps_and_the_corrected_one_rests():
    told = lines(equation2, 5)
    published, corrected = (
        [float(word) for word in line.replace(",", "").split() if word[0] in "+-"] for line in told[3:5]
    )
    assert max(published) > 0.2 and min(published) < -0.4  # noqa: PT018
    assert max(np.abs(corrected)) < 0.05


def test_a_riddle_has_a_name(capsys):
    with pytest.raises(SystemExit):
        main(["figure10"])
    assert "did you mean figure9?" in capsys.readouterr().err
