# SPDX-License-Identifier: BSD-3-Clause
"""What is off by as much however the chair moves."""

import pytest
import unknown_effects as hidden
import yaml

from kurumaisu.critic import pipeline
from kurumaisu.critic.search.curve_search import CurveSearch
from kurumaisu.critic.unknown import sentences
from kurumaisu.critic.unknown.joint_fit import fit_with_curve
from kurumaisu.params import load_model, shipped


@pytest.mark.parametrize(("channel", "name"), [(0, "v"), (1, "lateral"), (2, "w")])
def test_what_follows_nothing_is_no_curve_over_something(channel, name):
    drift = hidden.Kind(channel, "moving", lambda s, a, b: 1.0)
    case = hidden.make(drift, 12.0, 1007, seconds=40.0, runs=2)
    problem = hidden.problem_of(case.recording)
    best = CurveSearch(problem).beside(problem.fit_candidates((), {}))[0]
    assert best.curve.id == f"smooth.{name}.moving"
    extension = fit_with_curve(problem, best.fit, best.curve, best.evidence.prior)
    assert extension.coefficients[0] == pytest.approx(case.size, rel=0.25)
    assert sentences.shape(extension).startswith("constant, ")
    assert "follows no known quantity" in sentences.headline(extension)


def test_a_constant_is_written_for_the_simulator_and_shown(tmp_path):
    drift = hidden.Kind(0, "moving", lambda s, a, b: 1.0)
    recording = hidden.make(drift, 30.0, 1008, seconds=40.0, runs=3).recording
    ids = frozenset(
        {"base.gain_v", "base.gain_w", "smooth"}
    )  # without the offset of a converter, which does nearly that
    found = pipeline.criticise(recording, shipped("launch/md100.yaml"), lambda _: None, ids=ids)
    assert (found.verdict.verdict, found.verdict.unknown[0].covariate) == ("unknown", "constant")
    pipeline.write(found, shipped("launch/md100.yaml"), tmp_path)
    (written,) = (e for e in yaml.safe_load((tmp_path / "extended.yaml").read_text())["effects"] if "smooth" in e["id"])
    assert written["id"] == "smooth.v.moving"
    assert written["id"] in {setting.id for setting in load_model(tmp_path / "extended.yaml").effects}
    assert "constant" in (tmp_path / "report.html").read_text()
