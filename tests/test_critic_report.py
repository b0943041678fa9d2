# SPDX-License-Identifier: BSD-3-Clause
"""What the report and the terminal make of a criticism: pictures that show the effect, small pages, plain words."""

import base64
import csv
import io
import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from stories import full_story, full_verdict

from kurumaisu.critic.app.display import cells, cut, printable
from kurumaisu.critic.app.job import Job, Outcome
from kurumaisu.critic.app.results import summary, table
from kurumaisu.critic.judge.sentences import named_causes, wrong_data
from kurumaisu.critic.report.figures import misfit_svg, shown_points
from kurumaisu.critic.report.page import comparison_picture, misfit_picture, overlay_picture, report_page, thinned
from kurumaisu.critic.values.digits import odds, quantities, with_interval
from kurumaisu.critic.values.story import Bins, Comparison, Moments, Overlay, explained
from kurumaisu.critic.values.verdict import Cause, Estimate, Verdict, grouped
from kurumaisu.whole_files import write_whole

NOWHERE = ["", "", "", ""]  # a mean is of no single moment
NBSP = "\N{NO-BREAK SPACE}"


def rows_of(picture):
    head, _, data = picture.data.partition(",")
    assert head == "data:text/csv;charset=utf-8;base64"
    return list(csv.reader(io.StringIO(base64.b64decode(data).decode())))


def long_story():
    """An hour: twelve runs of 300 s at 10 Hz; six effects, whose pictures hold 36 000 increments each."""
    rng = np.random.default_rng(3)
    path = np.cumsum(rng.normal(scale=0.05, size=(3000, 2)), axis=0)
    torn = path.copy()
    torn[100::101] = np.nan
    t = 1.7e9 + 0.1 * np.arange(36000)
    overlays = tuple(Overlay(f"run_{i}", path, torn, torn + 0.01, False, 10.0, 0.3, 0.1, t[:3000]) for i in range(12))
    x, y = rng.normal(size=36000), rng.normal(size=36000)
    misfit = full_story().misfits[0]
    bins = Bins(*(np.linspace(-1, 1, 15) for _ in range(4)))
    moments = Moments(("run_1", "run_2"), np.arange(36000) % 2, t, rng.normal(size=(36000, 2)))
    whole = replace(misfit, covariate=x, residual=y, after=bins, moments=moments)
    return replace(full_story(), overlays=overlays, misfits=(whole,) * 6)


def test_an_hour_makes_a_small_page(tmp_path):
    write_whole({tmp_path / "report.html": report_page(full_verdict(), long_story())})
    assert (tmp_path / "report.html").stat().st_size < 2e6


def test_runs_beyond_a_dozen_are_counted_not_drawn(tmp_path):
    story = full_story()
    write_whole({tmp_path / "report.html": report_page(full_verdict(), replace(story, overlays=story.overlays * 3))})
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count('role="img"') == 12 + len(story.misfits)
    assert "6 more runs are not shown" in page
    text = re.sub(r'href="data:[^"]*"|<svg.*?</svg>', "", page, flags=re.DOTALL)
    assert not re.search(r"\bnan\b", text)  # an interval that nobody knows is left out


def test_a_thinned_path_keeps_its_ends_and_its_gaps():
    story = long_story()
    for before, after in zip(story.overlays, thinned(story.overlays), strict=True):
        assert len(after.measured) < len(before.measured) / 4
        np.testing.assert_array_equal(after.measured[[0, -1]], before.measured[[0, -1]])
        np.testing.assert_array_equal(after.baseline[[0, -1]], before.baseline[[0, -1]])
        assert np.isnan(after.baseline[:, 0]).sum() == np.isnan(before.baseline[:, 0]).sum()


def test_short_paths_are_not_thinned():
    story = full_story()
    for before, after in zip(story.overlays, thinned(story.overlays), strict=True):
        np.testing.assert_array_equal(after.measured, before.measured)


def test_the_pieces_of_a_path_are_told_apart_in_its_data():
    path = np.array([[0.0, 0.0], [1.0, 0.5], [np.nan, np.nan], [2.0, 1.5]])
    picture = overlay_picture(Overlay("a", path[[0, 1, 3]], path, None, False, 10.0, 0.25, None), "run0")
    rows = rows_of(picture)
    assert rows[0] == ["path", "piece", "x [m]", "y [m]", "run", "t [s]"]
    assert [row for row in rows if row[0] == "baseline"] == [
        ["baseline", "1", "0", "0", "", ""],
        ["baseline", "1", "1", "0.5", "", ""],
        ["baseline", "2", "2", "1.5", "", ""],
    ]
    assert picture.caption.replace(NBSP, " ") == "Error after 10 s: 0.250 m with the original model (rms)."


def test_a_misfits_data_hold_the_means_before_and_after():
    misfit = full_story().misfits[0]
    after = Bins(np.array([0.5]), np.array([0.01]), np.array([-0.02]), np.array([0.04]))
    rows = rows_of(misfit_picture(replace(misfit, after=after), "misfit0"))
    assert ["mean after", "0.5", "0.01", *NOWHERE] in rows
    assert ["mean after, upper end", "0.5", "0.04", *NOWHERE] in rows
    assert ["mean before", "-1", "-0.1", *NOWHERE] in rows
    assert not [row for row in rows_of(misfit_picture(misfit, "misfit0")) if row[0].startswith("mean after")]


def test_a_comparison_shows_what_was_furthest_off_and_its_data_show_all():
    count = 30
    measured = np.arange(count, dtype=float)
    names = tuple(f"number {i}" for i in range(count))
    comparison = Comparison("laser.x", names, measured, np.zeros(count), measured, np.full(count, 0.5))
    picture = comparison_picture(comparison, "numbers0")
    assert "number 29" in picture.svg
    assert "number 3<" not in picture.svg
    rows = rows_of(picture)
    assert len(rows) == 1 + count
    assert rows[-1] == ["number 29", "29", "0", "29", "0.5"]


@pytest.mark.parametrize(("unit", "scale", "label"), [("m", 0.001, "[mm]"), ("m", 1.0, "[m]"), ("rad", 1.0, "[°]")])
def test_axes_are_in_units_that_suit(unit, scale, label):
    misfit = full_story().misfits[0]
    bins = Bins(*(scale * part for part in vars(misfit.bins).values()))
    x = scale * misfit.covariate
    changed = replace(misfit, covariate=x, covariate_unit=unit, covariate_name="range", bins=bins, curve=None)
    assert f"range {label}" in misfit_svg(changed, shown_points(changed), "a")


def test_names_in_any_script_are_drawn_as_text_without_a_warning():
    misfit = replace(full_story().misfits[0], covariate_name="電池 <b> Übung")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        svg = misfit_svg(misfit, shown_points(misfit), "a")
    assert "電池 &lt;b&gt; Übung" in svg


def test_a_covariate_explains_what_follows_it_and_not_what_does_not():
    rng = np.random.default_rng(11)
    x = rng.uniform(-1, 1, 3000)
    assert explained(x, x**2) > 0.95
    assert explained(x, rng.normal(size=3000)) < 0.05


@pytest.mark.parametrize(
    ("nats", "said"), [(-1.0, "1.0"), (0.5, "1.6"), (3.0, "20"), (7.0, "1 000"), (30.0, "more than 10 000")]
)
def test_evidence_is_said_as_odds(nats, said):
    assert odds(nats) == said


def test_sizes_have_one_unit_and_no_negative_zero():
    assert with_interval(0.0435, 0.0397, 0.0472, "s").replace(NBSP, " ") == "43.5 ms (90 %: 39.7 to 47.2 ms)"
    assert quantities([0.102], "1") == ["0.102"]
    assert quantities([-0.0001, 5.0], "V")[0].replace(NBSP, " ") == "0.00 V"


def test_causes_are_named_with_sizes_and_beyond_four_by_id():
    cause = Cause("base.lag_w", 0.98, {"tau": Estimate(0.0435, 0.04, 0.047, "s")}, 41.0)
    said = named_causes([cause])
    assert said.replace(NBSP, " ").endswith("(base.lag_w: tau 43.5 ms).")
    assert said[0].isupper()
    others = [replace(cause, id=name) for name in ("base.gain_v", "base.delay", "base.veer", "base.slope", "base.sign")]
    assert named_causes([cause, *others]).endswith("; and base.slope, base.sign.")


def test_problems_that_differ_in_their_run_only_are_one():
    problems = ("run_1: clock jumps: at 3 s", "run_2: clock jumps: at 5 s", "run_1: no map", "odd")
    assert grouped(problems) == [
        ("clock jumps", ["run_1: clock jumps: at 3 s", "run_2: clock jumps: at 5 s"]),
        ("no map", ["run_1: no map"]),
        ("odd", ["odd"]),
    ]
    assert wrong_data(problems) == "The data are wrong, so nothing was fitted: clock jumps; no map; and 1 more."


def outcome(name="corridor", **changes):
    job = Job(Path("r"), Path("out"), name)
    return Outcome(job, 3.0, **{"verdict": full_verdict(), "headline": "The chair turns late.", **changes})


def test_the_terminal_is_told_the_verdict_and_what_to_drive_next():
    said = summary(outcome(details=("5 drives.",), next_drive="critic experiment spin_both_ways (20 s)."), 200)
    lines = said.splitlines()
    assert lines[:3] == ["verdict: named", "The chair turns late.", "  5 drives."]
    assert "  position after 5 s: rms error 83.1 -> 41.2 mm" in lines
    assert lines[-1] == "drive next: critic experiment spin_both_ways (20 s)."
    assert "drive next" not in summary(outcome(), 200)


def test_the_terminal_is_told_what_was_mended_in_the_data_once_for_all_runs():
    problems = ("run_1: rows are repeated: 7", "run_2: rows are repeated: 4", "run_1: a note that is told anyway")
    told = replace(full_verdict(), problems=problems)
    lines = summary(outcome(verdict=told, details=("run_1: a note that is told anyway",)), 200).splitlines()
    assert [line for line in lines if line.startswith("  data:")] == [
        "  data: run_1: rows are repeated: 7 (and 1 more like it)"
    ]


def test_lines_are_wrapped_between_words_and_indented():
    told = outcome(headline="Short.", details=("one two three four five six seven",))
    said = summary(told, 20).splitlines()
    assert said[2:4] == ["  one two three four", "    five six seven"]
    assert all(len(line) <= 20 for line in said if len(line.split()) > 2)


def test_a_table_stays_in_line_whatever_the_names_are_made_of():
    names = ("short", "a_name_that_goes_on_and_on_and_on", "廊下_走行_二〇二六年")
    lines = table([outcome(name, verdict=Verdict("none")) for name in names], 60).splitlines()
    columns = [cells(line[: line.index("none")]) for line in lines[1:4]]
    assert len(set(columns)) == 1
    assert all(cells(line) <= 60 for line in lines[:4])


def test_text_is_cut_by_the_cells_that_it_takes():
    assert cut("走行", 4) == "走行"
    assert cut("走行記録", 5) == "走行…"
    assert cells(cut("走行記録", 4)) <= 4
    assert cut("plain", 0) == ""
    assert printable(f"3{NBSP}ms\x1b[2J") == "3 ms?[2J"


def test_every_point_of_a_misfit_is_found_with_its_moment_and_its_place_where_the_picture_says():
    """The dots of the SVG are matplotlib's own; data-at must lead from the data to them."""
    story = long_story()
    misfit = story.misfits[0]
    picture = misfit_picture(misfit, "misfit0")
    samples = [row for row in rows_of(picture) if row[0] == "sample"]
    a, b, c, d = map(float, re.search(r'data-at="([^"]*)"', picture.svg)[1].split())
    dots = {tuple(map(float, pair)) for pair in re.findall(r"M([\d.]+) ([\d.]+)h0", picture.svg)}
    assert len(dots) > 1000
    said = {(a + b * float(x), c + d * float(y)) for _, x, y, *_ in samples}
    near = np.array(sorted(said))
    off = [np.abs(near - dot).max(axis=1).min() for dot in dots]
    assert max(off) < 0.06  # dots are rounded to a tenth of a point
    for _, x, _, run, t, px, py in samples[::50]:
        row = round((float(t) - 1.7e9) * 10)
        assert float(x) == pytest.approx(misfit.covariate[row], rel=1e-4)
        assert run == f"run_{row % 2 + 1}"
        assert [float(px), float(py)] == pytest.approx(misfit.moments.places[row], rel=1e-4)


def test_what_is_furthest_off_is_in_the_data_though_the_picture_leaves_it_out():
    misfit = full_story().misfits[0]
    residual = misfit.residual.copy()
    residual[7] = -1e3
    rows = rows_of(misfit_picture(replace(misfit, residual=residual), "misfit0"))
    (row,) = [row for row in rows if row[0] == "sample" and row[2] == "-1000"]
    assert row[3:5] == ["run_2", "1700000000.700"]


def test_a_measured_path_tells_its_times_thinned_or_not():
    overlay = full_story().overlays[0]
    rows = [row for row in rows_of(overlay_picture(overlay, "run0")) if row[0] == "measured"]
    assert [row[4:] for row in rows[:2]] == [["run_1", "1700000000.000"], ["run_1", "1700000000.100"]]
    story = long_story()
    for before, after in zip(story.overlays, thinned(story.overlays), strict=True):
        index = np.searchsorted(before.times, after.times)
        np.testing.assert_array_equal(before.measured[index], after.measured)
