# SPDX-License-Identifier: BSD-3-Clause
"""The report: complete, self-contained, and safe to open whatever a recording is called."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from stories import full_story, full_verdict

from kurumaisu.critic.report.figures import MOST_POINTS, shown_points
from kurumaisu.critic.report.page import LARGEST, quantities, report_page
from kurumaisu.critic.values.story import Story
from kurumaisu.critic.values.verdict import Verdict

NBSP = "\N{NO-BREAK SPACE}"
VOID = {"meta", "br", "img", "link"}


class Page(HTMLParser):
    """Elements and visible text of a page; fails on tags that do not match."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.text = [], [], ""
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "style" not in self.open:
            self.text += data

    def all(self, tag):
        return [attrs for name, attrs in self.tags if name == tag]


def page_of(tmp_path, verdict, story):
    text = report_page(verdict, story)
    return text, Page(text)


def test_the_page_says_what_verdict_and_story_hold(tmp_path):
    _, page = page_of(tmp_path, full_verdict(), full_story())
    said = " ".join(page.text.split())
    for words in (
        "Cause named",
        "The chair turns late.",
        "+0.370 nats",
        "1.45 times as probable",
        f"83.1 → 41.2{NBSP}mm".replace(NBSP, " "),
        "base.lag_w",
        "0.190 to 0.230 s",
        "base.cross_w_to_v: turning moves the chair",
        "period 2 pi",
        "20 rows are repeated",
        "\N{MINUS SIGN}6.1 nats",
        "fits worse by 6.1 nats",
        "400 times",
        "Error after 10 s: 0.424 m with the original model, 0.004 m with the extended one (rms).",
        "Drive next: Spin both ways.",
        "4.90 mrad",
        "Nothing that these drives show.",
        "Spin both ways.",
        "Reference pose: measured.",
        "run_6, held out",
        "2 more",
    ):
        assert words in said, words
    order = ["The chair turns late.", "+0.370", "Spin both ways.", "Causes", "Other explanations"]
    assert [said.index(words) for words in order] == sorted(said.index(words) for words in order)


def test_the_page_needs_nothing_from_elsewhere(tmp_path):
    text, page = page_of(tmp_path, full_verdict(), full_story())
    targets = [
        value for _, attrs in page.tags for name, value in attrs.items() if name in ("src", "href", "xlink:href")
    ]
    assert targets
    assert all(target.startswith(("data:", "#")) for target in targets)
    assert not page.all("script")
    assert not page.all("link")
    assert "@import" not in text
    assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", text))


def test_ids_are_unique_and_every_reference_finds_its_own(tmp_path):
    text, page = page_of(tmp_path, full_verdict(), full_story())
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(ids) == len(set(ids))
    used = set(re.findall(r'(?:url\(|href=")#([^)"]+)', text))
    assert used
    assert used <= set(ids)


def test_every_picture_has_words_and_its_data(tmp_path):
    _, page = page_of(tmp_path, full_verdict(), full_story())
    pictures = [attrs for attrs in page.all("div") if attrs.get("role") == "img"]
    assert len(pictures) == len(page.all("svg")) == 7
    assert all(len(attrs["aria-label"]) > 20 for attrs in pictures)
    links = [attrs for attrs in page.all("a") if "download" in attrs]
    assert len(links) == 7
    story = full_story()
    data = base64.b64decode(links[0]["href"].split(",")[1]).decode().splitlines()
    assert data[0] == "kind,covariate [rad/s],misfit [rad/s],run,t [s],x [m],y [m]"
    drawn = shown_points(story.misfits[0]).index.sum()
    assert drawn <= len([row for row in data if row.startswith("sample,")]) <= drawn + LARGEST
    run = base64.b64decode(links[1]["href"].split(",")[1]).decode().splitlines()
    assert run[0] == "path,piece,x [m],y [m],run,t [s]"
    first = [float(cell) for cell in run[1].split(",")[2:4]]
    np.testing.assert_allclose(first, story.overlays[5].measured[0], rtol=1e-4)


def test_names_from_a_recording_cannot_become_markup(tmp_path):
    evil = '<script>alert(1)</script>$\\frac{--><img src=x onerror=alert(1)>"'
    story = full_story()
    story = replace(
        story,
        recording=evil,
        model=evil,
        headline=evil,
        details=(evil,),
        pose_source=evil,
        provenance={evil: evil},
        next_drive=evil,
        unexplained=(evil,),
        rivals=(replace(story.rivals[0], id=evil, why=evil),),
        noise=(replace(story.noise[0], name=evil, unit=evil),),
        overlays=(replace(story.overlays[0], run=evil),),
        misfits=(replace(story.misfits[0], channel=evil, covariate_name=evil, unit=evil, explained_by=evil),),
    )
    text, page = page_of(tmp_path, replace(full_verdict(), problems=(evil,)), story)
    assert not page.all("script")
    assert not page.all("img")
    assert not any(name.startswith("on") for _, attrs in page.tags for name in attrs)
    assert "<script" not in text
    assert page.text.count("alert(1)</script>") >= 10


@pytest.mark.parametrize(("kind", "gain"), [("none", True), ("invalid_data", False)])
def test_a_verdict_without_gain_or_pictures_makes_a_page(tmp_path, kind, gain):
    story = Story("r", "m", "Nothing to see.", (), "measured", {})
    _, page = page_of(tmp_path, Verdict(kind, problems=("a clock jumps",)), story)
    assert "Nothing to see." in page.text
    assert ("no gain to measure" in page.text) == gain
    assert "Causes" not in page.text


def test_the_same_story_makes_the_same_page(tmp_path):
    first, _ = page_of(tmp_path, full_verdict(), full_story())
    second, _ = page_of(tmp_path, full_verdict(), full_story())
    assert first == second


def test_a_picture_stays_small_and_shows_means_whatever_the_outliers():
    misfit = full_story().misfits[0]
    residual = misfit.residual.copy()
    residual[:3] = [1e6, -1e6, np.nan]
    shown = shown_points(replace(misfit, residual=residual))
    assert shown.index.sum() <= MOST_POINTS
    assert not shown.index[:3].any()
    assert shown.low < misfit.bins.lo90.min()
    assert shown.high > misfit.bins.hi90.max()
    assert shown.high < 10


@pytest.mark.parametrize(
    ("values", "unit", "said"),
    [
        ([0.0831, 0.0412], "m", ["83.1 mm", "41.2 mm"]),
        ([1.52, -0.104], "m", ["1.52 m", "\N{MINUS SIGN}0.10 m"]),
        ([0.2131], "s", ["0.213 s"]),
        ([0.031], "", ["0.0310"]),
        ([1234.5], "nats", ["1234 nats"]),
        ([float("nan"), 2.0], "V", ["– V", "2.00 V"]),
        ([0.0], "m", ["0 m"]),
        ([1e-9], "", ["1e\N{MINUS SIGN}09"]),
    ],
)
def test_numbers_are_said_to_three_digits_in_a_unit_that_suits(values, unit, said):
    assert [text.replace(NBSP, " ") for text in quantities(values, unit)] == said
