# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's page in a real browser: several robots, several rangers, and what happens between two pictures."""

import io

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect
from viewer_page_rig import Shown, Visit, until


@pytest.fixture
def shown():
    with Shown(robots=3) as one:
        one.rig.paused = True
        yield one


def drives(shown):
    return [(one.get("body"), one["v"]) for one in shown.rig.asked("drive")]


def test_the_robot_that_is_chosen_is_driven(visit, shown):
    page, rig = visit.page, shown.rig
    page.locator("#drive").click()
    robot = page.get_by_label("Robot", exact=True)
    expect(robot.locator("option")).to_have_text(["chair", "robot 0", "robot 1", "robot 2"])
    expect(robot.locator("option:checked")).to_have_text("chair")
    page.keyboard.down("w")
    until(lambda: drives(shown), "the chair drives")
    page.mouse.click(*visit.spot(*rig.poses["r1"][:2]))
    expect(robot.locator("option:checked")).to_have_text("robot 1")
    until(lambda: drives(shown)[-1] == ("1", 0.0), "the chair is let go")
    count = len(drives(shown))
    page.keyboard.down("w")  # as the repeats of the key that is still held
    page.keyboard.up("w")
    page.keyboard.down("w")
    until(lambda: len(drives(shown)) >= count + 2, "the other one drives")
    page.keyboard.up("w")
    until(lambda: drives(shown)[-1] == ("r1", 0.0), "it stops")
    assert {body for body, v in drives(shown)[count:]} == {"r1"}
    page.mouse.click(*visit.spot(-1.0, 1.0))  # the box, which nobody drives
    expect(page.locator("#body-select option:checked")).to_have_text("<b>box</b> (obstacle)")
    expect(robot.locator("option:checked")).to_have_text("robot 1")
    robot.select_option(label="robot 2")
    page.keyboard.down("s")
    until(lambda: drives(shown)[-1] == ("r2", -0.25), "the third one drives back")
    page.keyboard.up("s")


def test_one_robot_leaves_no_choice(browser):
    with Shown() as alone, Visit(browser, alone.link) as visit:
        visit.page.locator("#drive").click()
        expect(visit.page.locator("#stick-box")).to_be_visible()
        expect(visit.page.locator("#drive-who")).to_be_hidden()


def picture_of(page):
    with page.expect_download() as download:
        page.locator("#screenshot").click()
    return np.asarray(Image.open(io.BytesIO(download.value.path().read_bytes())).convert("RGB")).astype(int)


def show_only(page, layer):
    page.locator("#tab-view").click()
    for box in page.locator(f"[data-layer]:not([data-layer={layer}])").all():
        box.uncheck()


def patch(visit, x, y, reach=6):
    """Return the pixels around a place of the world."""
    corner = visit.page.locator("#front").bounding_box()
    px, py = visit.spot(x, y)
    row, column = round(py - corner["y"]), round(px - corner["x"])
    return picture_of(visit.page)[row - reach : row + reach + 1, column - reach : column + reach + 1]


def test_every_ranger_of_a_robot_is_shown(browser, shown):
    with Visit(browser, shown.link, color_scheme="light") as visit:
        show_only(visit.page, "scans")
        x, y, _ = shown.rig.poses["1"]  # looks up; so the second ranger looks down
        assert (patch(visit, x, y - 1.0) == 255).all()
        shown.rig.rear = 1.0
        until(lambda: (patch(visit, x, y - 1.0) < 255).any(), "the second ranger's echoes")
        shown.rig.rear = 0.5
        until(lambda: (patch(visit, x, y - 1.0) == 255).all(), "its next scan has taken the last one's place")
        assert (patch(visit, x, 4.0) < 255).any()  # the first ranger's wall


def test_a_contact_between_two_pictures_is_not_missed(browser, shown):
    shown.rig.contacts = {"1": 2}  # those from before somebody looked are not news
    with Visit(browser, shown.link, color_scheme="light") as visit:
        page = visit.page
        show_only(page, "marks")
        x, y, _ = shown.rig.poses["1"]
        assert (patch(visit, x, y) == 255).all()
        shown.rig.contacts = {"1": 3}  # and it was over before the next moment: `hit` never had it
        until(lambda: (patch(visit, x, y) < 255).any(), "a mark")


def test_the_speed_that_is_wanted_is_shown(visit, shown):
    speed = visit.page.get_by_label("Speed", exact=True)
    expect(speed).to_have_value("1")
    shown.rig.speed = 3.5  # a launch file's, or another page's
    expect(speed).to_have_value("3.5")
    expect(speed.locator("option:checked")).to_have_text("3.5×")
    speed.select_option("0.5")
    until(lambda: shown.rig.speed == 0.5, "half as fast")
    shown.rig.speed = 0.0
    visit.page.locator("#front").focus()
    expect(speed.locator("option:checked")).to_have_text("max")
