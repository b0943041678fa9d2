# SPDX-License-Identifier: BSD-3-Clause
"""What data held out have to say before a finding counts, by how much evidence it has already."""

import pytest

from kurumaisu.critic.heldout.materiality import confirmed, matters
from kurumaisu.critic.values.verdict import Gain, LogDensityGain


def worth(gain, sd):
    return Gain(LogDensityGain(0.0, gain, gain, gain - 1.645 * sd, gain + 1.645 * sd))


@pytest.mark.parametrize(
    ("gain", "nats", "free", "counts"),
    [
        (2.0, 3.0, False, True),  # by its own interval
        (1.0, 4.0, False, False),
        (1.0, 6.0, False, True),  # likely is enough
        (0.5, 9.0, False, False),
        (1.0, 7.0, True, False),
        (0.5, 13.0, False, True),  # it must only not lose
        (-0.1, 25.0, False, False),
        (0.5, 25.0, True, False),  # a free curve may fit what comes once
        (1.0, 25.0, True, True),
    ],
)
def test_the_more_evidence_the_less_has_a_short_drive_to_gain(gain, nats, free, counts):
    assert confirmed(worth(gain, 1.0), nats, free=free) is counts


def test_without_data_held_out_nothing_is_confirmed():
    assert not confirmed(None, 1000.0)


@pytest.mark.parametrize(
    ("share", "felt", "expected"),
    [(0.01, 0.0, True), (0.001, 0.2, True), (0.001, 0.05, False), (1e-5, 100.0, False)],
)
def test_what_moves_nothing_does_not_matter_beside_no_noise(share, felt, expected):
    assert matters(share, felt) == expected
