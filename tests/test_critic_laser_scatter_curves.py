# SPDX-License-Identifier: BSD-3-Clause
"""Readings that scatter more here or then than there: what is in no catalogue, of the noise."""

from dataclasses import replace

import numpy as np
import pytest
from laser_scene import recording

from kurumaisu import effects
from kurumaisu.critic import pipeline
from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.effects import Echoes
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, load_model, shipped

MD100 = shipped("launch/md100.yaml")
USUAL = 0.004  # [m] sd of these scans, about


def shaken(data, where, sd):
    """A recording whose readings are noisier by sd [m] where(scan, beam)."""
    run = data.runs[0]
    at = where(*np.indices(run.scan.values.shape))
    more = np.random.default_rng(5).normal(0.0, sd, at.shape) * at
    return replace(data, runs=(replace(run, scan=replace(run.scan, values=np.round(run.scan.values + more, 3))),))


def factor(setting, **at):
    """How much noisier an effect makes one reading."""
    one = np.ones(1)
    known = {key: value for key, value in at.items() if key in ("v", "w")}
    scan = Echoes(at.get("time", 0.0), at.get("bearing", 0.0) * one, 2 * one, 0 * one, one, 2 * one, one, one, 2 * one)
    chain = effects.build_laser((setting,), np.random.default_rng(0))
    return chain.read(replace(scan, known=known))[0] - 2


@pytest.mark.parametrize(
    ("covariate", "where"),
    [
        ("bearing", lambda scan, beam: beam > 0.6 * beam.max()),
        ("time", lambda scan, beam: scan > 0.5 * scan.max()),
    ],
)
def test_noise_that_follows_something_is_outside_the_catalogue(tmp_path, covariate, where):
    data = shaken(recording(tmp_path, None, 0.0, 11, scans=30), where, 1.5 * USUAL)
    criticism = pipeline.criticise(data, MD100, lambda _: None)
    verdict = criticism.verdict
    assert verdict.verdict == "unknown"
    first = verdict.unknown[0]
    assert (first.channel, first.covariate) == ("laser.scatter", covariate)
    assert first.p > 0.9
    assert not [cause.id for cause in verdict.causes if cause.id.startswith("laser")]
    pipeline.write(criticism, MD100, tmp_path / "out")
    extended = load_model(tmp_path / "out" / "extended.yaml")
    (curve,) = [own for own in extended.effects if own.id == f"smooth.scatter.{covariate}"]
    knots = [value for name, value in curve.parameters.items() if name.startswith("knot")]
    quiet, loud = (factor(curve, **{covariate: knots[0] + share * (knots[-1] - knots[0])}) for share in (0.25, 0.9))
    assert loud / quiet > 1.3


def test_noise_that_comes_and_goes_follows_the_time(tmp_path):
    """Every seven seconds for two: a curve that bends every four sees none of it."""
    data = shaken(recording(tmp_path, None, 0.0, 11, scans=100), lambda scan, beam: scan // 6 % 3 == 0, 1.0 * USUAL)
    finding = criticise_scans(data, load_model(MD100), lambda _: None)
    assert (finding.unknown[0].channel, finding.unknown[0].covariate) == ("laser.scatter", "time")
    assert not finding.causes


def test_a_curve_multiplies_the_noise_where_what_it_follows_is_known():
    setting = EffectSetting("smooth.scatter.v", {"knot_0": 0.0, "knot_1": 0.4, "value_0": 0.0, "value_1": np.log(2)})
    assert factor(setting, v=0.4) == pytest.approx(2)
    assert factor(setting, v=-0.1) == pytest.approx(1)
    assert factor(setting) == pytest.approx(1)


def test_a_curve_of_the_noise_is_checked():
    with pytest.raises(Error, match=r"smooth\.scatter\.v: knots must increase"):
        effects.check(
            (EffectSetting("smooth.scatter.v", dict.fromkeys(("knot_0", "knot_1", "value_0", "value_1"), 0.0)),)
        )
