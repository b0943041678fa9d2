# SPDX-License-Identifier: BSD-3-Clause
"""From a point of the critic's report to its moment in the recording, in a real browser; and without any server."""

import base64
import hashlib
import re
from dataclasses import replace

import numpy as np
import pytest
from playwright.sync_api import expect
from stories import full_story, full_verdict
from view_rig import LASER, ROOM, drive, meta
from viewer_page_rig import Visit, until
from viewer_rig import viewer_settings

from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.report.page import report_page
from kurumaisu.critic.values.story import Moments, Overlay
from kurumaisu.critic.view.command import opened
from kurumaisu.viewer import report
from kurumaisu.whole_files import write_whole

NAMES = ("early", 'late, "again" & <b>more')  # what a folder may be called


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Two runs and a report whose only misfit stands out in the second one."""
    folder = tmp_path_factory.mktemp("drives")
    (folder / "room.world").write_text(ROOM)
    meta(folder, world="room.world", laser=LASER)
    runs = [drive(name, start) for name, start in zip(NAMES, (10.0, 5000.0), strict=True)]
    for run in runs:
        write_csv_run(folder / run.name, run)
    poses = [run.pose for run in runs]
    t = np.concatenate([pose.t for pose in poses])
    places = np.concatenate([pose.values[:, :2] for pose in poses])
    x = np.linspace(-1.0, 1.0, len(t))
    y = 0.01 * np.sin(9 * x)
    y[400] = 0.5
    misfit = full_story().misfits[0]
    moments = Moments(NAMES, np.repeat([0, 1], [len(pose.t) for pose in poses]), t, places)
    path = poses[1].values[:, :2]
    story = replace(
        full_story(),
        misfits=(replace(misfit, covariate=x, residual=y, moments=moments),),
        overlays=(Overlay(NAMES[1], path, path, None, False, 10.0, times=poses[1].t),),
    )
    (folder / "criticism").mkdir()
    write_whole({folder / "criticism" / "report.html": report_page(full_verdict(), story)})
    return folder


@pytest.fixture
def served(recording):
    with opened(recording, (), None, recording / "criticism", viewer_settings()) as one:
        yield one


def playback(served):
    return served.source._state(served.source._clock.at(0.0)).playback


def test_a_point_of_the_report_leads_to_its_moment_and_place(browser, served):
    with Visit(browser, served.address) as visit:
        viewer = visit.page
        with viewer.expect_popup() as popup:
            viewer.get_by_role("link", name="Critic's report").click()
        page, complaints = popup.value, []
        page.on("console", lambda m: complaints.append(m.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.reload()
        link = page.locator("figure a", has_text="t = 5010.00 s")
        expect(page.locator(".unserved")).to_be_hidden()
        page.get_by_text("largest misfits, in the viewer").click()
        expect(link).to_be_visible()
        assert NAMES[1] in link.text_content()
        svg = page.locator("svg[data-at]").first
        # a dot that is drawn by matplotlib, on the second half of the line: of the second run
        dots = re.findall(r"M([\d.]+) ([\d.]+)h0", svg.inner_html())
        left, top = max(((float(a), float(b)) for a, b in dots), key=lambda dot: dot[0])
        box, width = svg.bounding_box(), float(svg.get_attribute("viewBox").split()[2])
        scale = box["width"] / width
        svg.hover(position={"x": left * scale, "y": top * scale})
        expect(page.locator("figure p").first).to_contain_text(f"{NAMES[1]}, t = 5029.90 s")
        svg.click(position={"x": left * scale, "y": top * scale})
        until(lambda: playback(served).run == NAMES[1], "the other run is shown")
        until(lambda: playback(served).t == pytest.approx(5029.9), "its moment is shown")
        assert len(visit.context.pages) == 2  # the viewer's own window, not another one
        place = dict(part.split("=") for part in viewer.url.split("#")[1].split("&"))
        pose = served.source._state(5029.9).truth
        assert [float(place["x"]), float(place["y"])] == pytest.approx(pose[:2], abs=1e-3)
        assert complaints == []


def test_a_report_in_a_tab_of_its_own_leads_to_the_viewers_tab(browser, served):
    """Nobody opened it, so no window is known to it by name; a bookmark, or an address that was typed."""
    with Visit(browser, served.address) as visit:
        expect(visit.page.locator("#scrubber")).to_be_enabled()
        page = visit.context.new_page()
        page.goto(f"{served.server.address}report/report.html")
        page.get_by_text("largest misfits, in the viewer").click()
        page.locator("figure a", has_text="t = 5010.00 s").click()
        expect(page.get_by_role("status")).to_contain_text("t = 5010.00 s")
        expect(page.get_by_role("status")).to_contain_text("shown in the viewer's tab")
        until(lambda: playback(served).t == pytest.approx(5010.0), "its moment is shown")
        assert len(visit.context.pages) == 2


def test_a_report_says_why_the_viewers_tab_does_not_go_there(browser, served):
    with Visit(browser, served.server.address) as visit:  # without a token
        page = visit.context.new_page()
        page.goto(f"{served.server.address}report/report.html")
        page.get_by_text("largest misfits, in the viewer").click()
        page.locator("figure a", has_text="t = 5010.00 s").click()
        expect(page.get_by_role("status")).to_contain_text("the link that the viewer printed")
        assert playback(served).run == NAMES[0]


def test_the_furthest_off_are_listed_and_marked_in_the_viewer(browser, served):
    with Visit(browser, served.address) as visit:
        page = visit.page
        page.get_by_role("tab", name="Misfits").click()
        first = page.locator("#residual-list a").first
        expect(first).to_contain_text(f"{NAMES[1]}, t = 5010.00 s")
        first.click()
        until(lambda: playback(served).t == pytest.approx(5010.0), "its moment is shown")
        expect(page.locator("#run")).to_have_value(NAMES[1])
        before = page.locator("#front").screenshot()
        page.get_by_role("checkbox", name="marks on the map").uncheck()
        until(lambda: page.locator("#front").screenshot() != before, "the marks are gone")


def test_an_address_with_a_moment_is_gone_to_at_once(browser, served):
    with Visit(browser, f"{served.address}&run=early&t=20.5&x=2.0&y=1.0"):
        until(lambda: playback(served).t == pytest.approx(20.5), "the moment is shown")


def test_a_recording_is_scrubbed_to_and_fro_and_played(browser, served):
    with Visit(browser, served.address) as visit:
        page = visit.page
        scrubber = page.get_by_role("slider", name="Moment of the recording")
        for t in (35.0, 12.0, 22.0):
            scrubber.fill(str(t))
            until(lambda t=t: playback(served).t == pytest.approx(t), f"{t} s is shown")
            expect(page.locator("#read-t")).to_have_text(f"{t - 10:.2f} s")
        page.locator("#rate").select_option("10")
        page.get_by_role("button", name="Play").click()
        until(lambda: playback(served).t == pytest.approx(39.9), "it has played to the end")
        expect(page.get_by_role("button", name="Play")).to_be_visible()
        page.get_by_label("Run").select_option(NAMES[1])
        until(lambda: playback(served).run == NAMES[1], "the other run is shown")


def test_without_a_token_nothing_moves(browser, served):
    with Visit(browser, served.server.address) as visit:
        expect(visit.page.locator("#scrubber")).to_be_disabled()
        expect(visit.page.locator("#banner")).to_contain_text("View only")


def test_a_report_opened_as_a_file_has_no_dead_link_and_says_what_to_run(browser, recording):
    context = browser.new_context()
    page, complaints = context.new_page(), []
    page.on("console", lambda m: complaints.append(m.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto((recording / "criticism" / "report.html").as_uri())
    expect(page.locator(".unserved")).to_contain_text("rosrun kurumaisu view")
    targets = page.eval_on_selector_all("a", "links => links.map((link) => link.getAttribute('href'))")
    assert targets
    assert all(target.startswith("data:text/csv") for target in targets)
    assert page.locator("script").count() == 0
    assert complaints == []
    context.close()


def test_what_the_report_serves_is_that_file_only(browser, served):
    context = browser.new_context()
    for name in ("verdict.json", "extended.yaml", "..%2f..%2fmeta.yaml"):
        assert context.request.get(f"{served.server.address}report/{name}").status == 404
    answer = context.request.get(f"{served.server.address}report/report.html")
    assert answer.status == 200
    assert "'unsafe-inline'" not in re.search(r"script-src[^;]*", answer.headers["content-security-policy"])[0]
    context.close()


def test_a_report_is_served_with_our_script_and_no_other():
    evil = (
        b"<html><head><style>a{}</style></head><body><style type='x'>b{}</style><script>alert(1)</script></body></html>"
    )
    body, headers = report.page(evil)
    policy = dict(part.split(" ", 1) for part in headers["Content-Security-Policy"].split("; "))
    assert policy["default-src"] == "'none'"
    assert policy["script-src"] == "'self'"  # so the inline one does not run
    for sheet in (b"a{}", b"b{}"):
        assert base64.b64encode(hashlib.sha256(sheet).digest()).decode() in policy["style-src-elem"]
    assert body.count(b'<script type="module" src="../page/report/report.js"></script>') == 1
    assert body.index(b"report.js") < body.index(b"</body>")
