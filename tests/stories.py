# SPDX-License-Identifier: BSD-3-Clause
"""A full verdict and story, for the tests of what is written."""

import numpy as np

from kurumaisu.critic.values.story import Alternative, Bins, Misfit, Moments, NoiseParameter, Overlay, Story
from kurumaisu.critic.values.verdict import (
    Cause,
    Estimate,
    Gain,
    LogDensityGain,
    NextExperiment,
    RmseGain,
    Unknown,
    Verdict,
)


def full_verdict():
    return Verdict(
        "named",
        causes=(Cause("base.lag_w", 0.98, {"tau": Estimate(0.2104, 0.19, 0.23, "s")}, 41.0),),
        confounded=(("base.cross_w_to_v", "base.marker_y"),),
        unknown=(Unknown("base.v", "heading", "period 2 pi, amplitude 0.02 m/s", 0.97),),
        problems=("run_1/pose.csv: 20 rows are repeated",),
        next_experiment=NextExperiment("spin_both_ways", 20.0, 12.3, ("base.lag_w", "base.delay")),
        gain=Gain(
            LogDensityGain(-1.2, -0.83, 0.37, 0.31, 0.43),
            {"position after 5 s": RmseGain(0.0831, 0.0412, 0.0419, 0.031, 0.052, "m")},
        ),
    )


def full_story():
    rng = np.random.default_rng(5)
    path = np.cumsum(rng.normal(size=(50, 2)), axis=0)
    x = rng.normal(size=3000)
    y = 0.1 * x + rng.normal(size=3000)
    bins = Bins(np.array([-1.0, 1.0]), np.array([-0.1, 0.1]), np.array([-0.2, 0.0]), np.array([0.0, 0.2]))
    curve = np.array([[-1.0, -0.1], [1.0, 0.1]])
    runs = [
        Overlay(f"run_{i}", path, path + 0.3, path + 0.003, i == 6, 10.0, 0.424, 0.004, 1.7e9 + 0.1 * np.arange(50))
        for i in range(1, 7)
    ]
    moments = Moments(
        ("run_1", "run_2"), np.arange(3000) % 2, 1.7e9 + 0.1 * np.arange(3000), rng.normal(size=(3000, 2))
    )
    return Story(
        recording="corridor",
        model="MD-100",
        headline="The chair turns late.",
        details=("5 drives, 210 s.",),
        pose_source="measured",
        provenance={"seed": "1"},
        overlays=tuple(runs),
        misfits=(
            Misfit("yaw rate", "rad/s", "change of w", "rad/s", x, y, bins, "base.lag_w", curve, None, None, moments),
        ),
        rivals=(Alternative("base.delay", -6.1, "fits worse by 6.1 nats"),),
        noise=(
            NoiseParameter("heading", 0.0049, "rad"),
            NoiseParameter("tau", 0.3, "s"),
        ),
        unexplained=("Nothing that these drives show.",),
        next_drive="Spin both ways.",
    )
