# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's page in a real browser: curves of its numbers."""

import csv
import math

import pytest
from playwright.sync_api import expect
from viewer_page_rig import until
from viewer_rig import RADIUS, SPEED


def shown_curves(page):
    return {
        row.locator("span").text_content(): row.locator("output").text_content()
        for row in page.locator("#plot-list li").all()
    }


def saved(page):
    """Return the columns of the saved table by their names."""
    with page.expect_download() as download:
        page.locator("#plot-save").click()
    with download.value.path().open(newline="") as file:
        names, *rows = csv.reader(file)
    return {name: [float(row[i]) if row[i] else math.nan for row in rows] for i, name in enumerate(names)}


def test_curves_are_chosen_drawn_and_saved(visit, shown):
    page = visit.page
    shown.rig.paused = False
    page.locator("#tab-plot").click()
    until(lambda: shown_curves(page) == {"v": "0.5 m/s", "commanded v": "0.5 m/s"}, "what is shown first")
    for label in ("odometry error [m]", "chair x [m]", "volts, forward [V]"):
        page.locator("#plot-add").select_option(label=label)
        page.locator("#plot").click()
    page.get_by_role("button", name="Remove commanded v").click()
    until(lambda: list(shown_curves(page)) == ["v", "odometry error", "chair x", "volts, forward"], "others")
    until(lambda: shown_curves(page)["odometry error"] == "0.1 m", "the rig's odometry is off by 0.1 m")
    drawn = page.locator("#plot").screenshot()
    until(lambda: page.locator("#plot").screenshot() != drawn, "the curves move")
    until(lambda: len(saved(page)["t [s]"]) > 30, "a second of them")
    table = saved(page)
    assert list(table) == ["t [s]", "v [m/s]", "odometry error [m]", "chair x [m]", "volts, forward [V]"]
    times = table["t [s]"]
    assert times == sorted(set(times))
    for t, x in zip(times, table["chair x [m]"], strict=True):
        if not math.isnan(x):
            assert x == pytest.approx(RADIUS * math.cos(t * SPEED / RADIUS), abs=1e-6)


def test_any_number_can_be_chosen_and_six_at_a_time(visit, shown):
    page = visit.page
    page.locator("#tab-plot").click()
    expect(page.locator("#plot-list li")).to_have_count(2)
    labels = page.locator("#plot-add option").all_text_contents()
    for label in ("ω [rad/s]", "truth yaw [°]", "localization error [m]", "range error, RMS [m]", "<b>box</b> y [m]"):
        assert label in labels
    for label in labels[1:5]:
        page.locator("#plot-add").select_option(label=label)
    expect(page.locator("#plot-list li")).to_have_count(6)
    expect(page.locator("#plot-add")).to_be_disabled()
    page.locator("#plot-clear").click()
    page.locator("#plot-list button").first.click()
    expect(page.locator("#plot-add")).to_be_enabled()
