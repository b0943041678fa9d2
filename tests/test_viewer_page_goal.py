# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's page in a real browser: goals, driven to where the source can."""

import math

from playwright.sync_api import expect
from test_viewer_page_control import drag, near
from viewer_page_rig import HOSTILE, Shown, Visit, until
from viewer_rig import ABILITIES


def set_goal(visit, start=(0.0, 0.0), end=(0.0, 1.0)):
    visit.page.locator("#goal").click()
    drag(visit, start, end)


def test_a_goal_is_set_driven_to_stopped_and_cleared(visit, shown):
    page, rig = visit.page, shown.rig
    expect(page.locator("#goal-box")).to_be_hidden()
    before = page.locator("#front").screenshot()
    set_goal(visit)
    asked = until(lambda: rig.asked("goal"), "a goal")[0]
    assert near((asked["x"], asked["y"], asked["yaw"]), 0.0, 0.0, math.pi / 2)
    expect(page.locator("#goal")).to_have_attribute("aria-pressed", "false")
    expect(page.locator("#toast")).to_have_text("The goal was published on /move_base_simple/goal, no nodes listening.")
    expect(page.locator("#goal-pose")).to_contain_text("°")
    until(lambda: page.locator("#front").screenshot() != before, "it is in the picture")
    page.locator("#go").click()
    expect(page.locator("#goal-text")).to_have_text("chair: driving there")
    assert rig.asked("go") == [{}]
    expect(page.locator("#go")).to_be_hidden()
    page.locator("#forget-goal", has_text="Stop").click()
    expect(page.locator("#goal-box")).to_be_hidden()
    assert rig.asked("forget_goal") == [{}]


def test_nobody_drives_in_an_emergency_stop(visit, shown):
    set_goal(visit)
    expect(visit.page.locator("#go")).to_be_enabled()
    shown.rig.estop = True
    expect(visit.page.locator("#go")).to_be_disabled()


def test_a_robot_is_only_told_of_its_goal(browser):
    robot = ABILITIES - {"go", "add", "delete", "restore", "set_pose"}
    with Shown(mode="robot", abilities=robot) as shown, Visit(browser, shown.link) as visit:
        expect(visit.page.locator("#goal")).to_be_enabled()
        set_goal(visit)
        expect(visit.page.locator("#forget-goal")).to_be_visible()
        expect(visit.page.locator("#go")).to_be_hidden()
        for id in ("box", "undo", "delete"):
            expect(visit.page.locator(f"#{id}")).to_be_hidden()


def test_frames_are_listed_as_a_tree_also_for_who_only_looks(browser):
    with Shown(control=False) as shown, Visit(browser, shown.link) as visit:
        visit.page.locator("#frames-list").click()
        rows = visit.page.locator("#frames-tree li")
        expect(rows).to_have_text(
            [
                "maproot",
                f"{HOSTILE}1.0 Hz, /somebody",
                "odomroot",
                "base_link20.0 Hz, /somebody",
                "laserstatic, /somebody",
            ]
        )
        expect(visit.page.locator("#frames-count")).to_have_text("3 transforms")
        assert shown.rig.commands == [("frames", {})]


def test_who_only_looks_sets_none(browser):
    with Shown() as shown, Visit(browser, shown.server.address) as visit:
        shown.rig.do_goal(1.0, 1.0, 0.0)
        expect(visit.page.locator("#goal-box")).to_be_visible()
        for id in ("goal", "go", "forget-goal", "box", "undo", "redo"):
            expect(visit.page.locator(f"#{id}")).to_be_disabled()
