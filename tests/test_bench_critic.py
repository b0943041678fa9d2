# SPDX-License-Identifier: BSD-3-Clause
"""The critic's table of floors counts each figure over the right recordings."""

import argparse
from dataclasses import replace

import pytest
from scipy.stats import binomtest

from kurumaisu.bench.critic import by_effect, floors, main
from kurumaisu.bench.hidden.baselines import BASELINES
from kurumaisu.bench.hidden.generator.case import Truth
from kurumaisu.bench.hidden.score import score, scored_names
from kurumaisu.critic.values.verdict import Cause, Verdict

OPTIONS = argparse.Namespace(draws=2, seed=0, jobs=1, log=None)


def rows(capsys, monkeypatch, truth_of, named_by_critic):
    """Return the table's rows by label, where the critic names what a function of the number of the draw says."""

    def answers(jobs, processes, log):
        out = []
        for i, job in enumerate(jobs):
            truth = truth_of(job.ask)
            critic = replace(scored_names(truth, named_by_critic(i, truth), 1.0), gain_share=None)
            assert job.baselines == (job.ask.family == "base" and truth.kind in ("null", "single", "pair", "triple"))
            others = {who: scored_names(truth, frozenset(), 1.0) for who in BASELINES} if job.baselines else {}
            out.append({"critic": critic, **others})
        return out

    monkeypatch.setattr(floors, "all_answers", answers)
    assert floors.run(OPTIONS) == 0
    lines = capsys.readouterr().out.splitlines()
    return {line[:31].strip(): line[31:] for line in lines if line[:1] not in ("", "-")}


def truth_of(ask):
    return Truth(ask.kind, ask.ids, z=20.0 if ask.ids != ("base.delay",) else 7.0)


def test_the_first_of_each_kind_is_missed(capsys, monkeypatch):
    found = rows(capsys, monkeypatch, truth_of, lambda i, truth: frozenset(truth.ids) if i else frozenset(["base.x"]))
    low, high = binomtest(1, 20).proportion_ci(0.9)
    assert f"0.05 ({low:.2f}-{high:.2f}) of 20" in found["false alarms, base"]
    assert "0.00 (0.00-0.14) of 20" in found["false alarms, base"]  # those who never name anything
    assert "0.98 (0.93-1.00) of 64" in found["another form, base, any z"]
    assert "of 62" in found["another form, base, strong"]  # the two delays are weak
    assert "of 62" in found["one cause exact, base, strong"]


def test_names_said_for_sure_count_against_it_where_nothing_is_hidden_that_has_a_name():
    truth = Truth("unknown", ("threshold_slip",), channel="v", covariates=("v",))
    misnamed = replace(scored_names(truth, frozenset(["base.gain_v"]), 1.0), stated=((0.97, False),))
    doubted = replace(misnamed, stated=((0.6, False),))
    figure = next(f for f in floors.FIGURES if f.label == "unknown: misnamed, p >= .9, base")
    assert figure.count([misnamed, doubted]).startswith("0.50")


def test_a_curve_that_is_not_among_the_first_three_is_not_found():
    truth = Truth("unknown", ("threshold_slip",), channel="v", covariates=("v",))
    assert not score(truth, Verdict("none"), 0.0).followed


@pytest.mark.parametrize(
    ("group", "right"),
    [(("a", "b"), True), (("a", "b", "c"), True), (("a", "b", "c", "d"), False), (("b", "c"), False)],
)
def test_a_set_may_have_what_is_told_apart_with_doubt(group, right):
    truth = Truth("confounded", ("a",), z=30.0, accepted=(("a",), ("b",)), near=("b", "c"))
    assert score(truth, Verdict("confounded", confounded=(group,)), 0.0).right == right


def test_where_nothing_does_the_same_the_name_is_right_too():
    alone = Truth("confounded", ("a",), z=30.0, z_rival=4.0, accepted=(("a",),), near=("b",))
    cause = Cause("a", 0.98, {}, 9.0)
    assert score(alone, Verdict("named", causes=(cause,)), 0.0).right
    assert not score(replace(alone, accepted=(("a",), ("b",))), Verdict("named", causes=(cause,)), 0.0).right


@pytest.mark.parametrize("figure", floors.FIGURES, ids=lambda figure: figure.label)
def test_a_figure_of_nothing_is_a_dash(figure):
    assert figure.count([]).startswith(("-", "nan"))


@pytest.mark.parametrize(
    "given",
    [["--effects", "base.delay"], ["--z", "0"], ["--form", "plain"], ["--form", "other"], ["--baselines"]],
    ids=" ".join,
)
def test_an_option_of_one_kinds_table_is_refused_without_the_kind(given, capsys, monkeypatch):
    monkeypatch.setattr(floors, "run", lambda options: pytest.fail("it ran as if nothing were said"))
    with pytest.raises(SystemExit) as stop:
        main.main(given)
    assert stop.value.code == 2
    assert f"error: {given[0]}: only with --kind" in capsys.readouterr().err


@pytest.mark.parametrize(("given", "form"), [([], "other"), (["--form", "plain"], "plain")])
def test_one_kinds_table_has_what_was_asked(given, form, monkeypatch):
    asked = []

    def answers(jobs, processes, log):
        asked.extend(jobs)
        truths = [Truth(job.ask.kind, job.ask.ids, z=7.0) for job in jobs]
        return [{"critic": replace(scored_names(t, frozenset(t.ids), 1.0), gain_share=None)} for t in truths]

    monkeypatch.setattr(by_effect, "all_answers", answers)
    options = ["--kind", "base", "--effects", "base.delay", "--z", "7", "--draws", "2", "--baselines", *given]
    assert main.main(options) == 0
    assert {(j.ask.ids, j.ask.z, j.ask.form, j.baselines) for j in asked} == {(("base.delay",), 7.0, form, True)}


def test_the_table_of_all_kinds_takes_what_concerns_all(monkeypatch):
    monkeypatch.setattr(floors, "run", lambda options: options.draws)
    assert main.main(["--draws", "3", "--seed", "5", "--jobs", "2", "--log", "a.jsonl"]) == 3
