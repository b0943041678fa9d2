# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's page in a real browser: what it commands."""

import math

import pytest
from playwright.sync_api import expect
from viewer_page_rig import LEGEND, until
from viewer_rig import HALF

BOX = (-1.0, 1.0)  # where the rig's box stands


def drag(visit, start, end, release=True):
    """Drag from one point of the world to another."""
    page = visit.page
    page.mouse.move(*visit.spot(*start))
    page.mouse.down()
    page.mouse.move(*visit.spot(*end), steps=4)
    if release:
        page.mouse.up()


def near(pose, x, y, yaw, tolerance=0.03):
    return math.hypot(pose[0] - x, pose[1] - y) < tolerance and abs(pose[2] - yaw) < tolerance


def test_a_body_is_dragged_and_turned(visit, shown):
    poses = shown.rig.poses
    drag(visit, BOX, (1.0, -1.0))
    until(lambda: near(poses["2"], 1.0, -1.0, 0.3), "the box is where it was put")
    expect(visit.page.locator("#body-select option:checked")).to_have_text("<b>box</b> (obstacle)")
    # the round handle stands before the box, 26 pixels from its corner
    reach = math.hypot(0.25, 0.25) + 26 / visit.scale()
    expect(visit.page.locator("#body-pose")).to_have_text("1.000 m, −1.000 m, 17.2°")
    drag(visit, (1.0 + reach * math.cos(0.3), -1.0 + reach * math.sin(0.3)), (1.0, 1.0))
    until(lambda: near(poses["2"], 1.0, -1.0, math.pi / 2), "the box is turned")


def test_a_place_that_is_refused_is_said_once(visit, shown):
    drag(visit, BOX, (4.3, 1.0), release=False)
    alarm = visit.page.locator("#alarm")
    expect(alarm).to_have_text("set_pose: 2 would stand in a wall")
    visit.page.mouse.up()
    visit.page.mouse.move(*visit.spot(0.0, 0.0))
    visit.page.wait_for_timeout(300)
    assert visit.page.locator("#log li").count() == 1


def test_escape_gives_back_what_is_dragged(visit, shown):
    drag(visit, BOX, (1.0, -1.0), release=False)
    until(lambda: near(shown.rig.poses["2"], 1.0, -1.0, 0.3), "it follows the pointer")
    visit.page.keyboard.press("Escape")
    until(lambda: near(shown.rig.poses["2"], *BOX, 0.3), "it is back")
    visit.page.mouse.up()


def test_a_drag_beside_bodies_moves_the_view_only(visit, shown):
    drag(visit, (0.0, -3.0), (0.0, -2.0))
    page = visit.page
    page.mouse.click(*visit.spot(BOX[0], BOX[1] + 1.0))  # the box has gone along
    expect(page.locator("#body-select option:checked")).to_have_text("<b>box</b> (obstacle)")
    assert shown.rig.commands == []


def test_the_wheel_zooms_about_the_pointer(visit):
    page = visit.page
    x, y = visit.spot(*BOX)
    page.mouse.move(x + 60, y)
    page.mouse.wheel(0, -math.log(2) / 0.0016)  # twice as large
    page.mouse.click(x - 60, y)
    expect(page.locator("#body-select option:checked")).to_have_text("<b>box</b> (obstacle)")


def test_keys_pause_step_stop_and_turn(visit, shown):
    page, rig = visit.page, shown.rig
    page.keyboard.press(".")
    until(lambda: rig.asked("step"), "a step")
    page.keyboard.press("p")
    until(lambda: not rig.paused, "it runs")
    expect(page.locator("#pause")).to_have_text("Pause")
    page.keyboard.press("p")
    until(lambda: rig.paused, "it is paused")
    page.keyboard.press("Space")
    until(lambda: rig.estop, "emergency stop")
    expect(page.locator("#estop")).to_have_text("Stopped: release")
    page.keyboard.press("Space")  # a key never lets go of it
    until(lambda: len(rig.asked("estop")) == 2, "the second press")
    assert rig.asked("estop")[1] == {"on": True}
    page.locator("#estop").click()
    until(lambda: not rig.estop, "released")
    page.mouse.click(*visit.spot(*BOX))
    page.keyboard.press("[")
    until(lambda: near(rig.poses["2"], *BOX, 0.3 + math.radians(5)), "turned by 5 degrees")


def test_what_is_written_is_no_command(visit, shown):
    visit.page.locator("#tab-effects").click()
    visit.page.locator("#effect-search").press_sequentially("tp. ?")
    expect(visit.page.locator("#effect-count")).to_contain_text("0 of")
    visit.page.locator("#seed").fill("7")
    visit.page.locator("#seed").press("Enter")
    until(lambda: shown.rig.asked("seed"), "the seed")
    assert shown.rig.commands == [("seed", {"value": 7})]
    expect(visit.page.locator("#stick-box")).to_be_hidden()


def test_an_effect_is_switched_and_sized(visit, shown):
    page, rig = visit.page, shown.rig
    page.locator("#tab-effects").click()
    page.locator("#effect-search").fill("base.lag_v")
    expect(page.locator("#effect-count")).to_have_text("1 of 60 effects, 0 on")
    row = page.locator(".effect-row:visible")
    row.locator("summary").click()
    number = row.get_by_label("base.lag_v, tau [s], as a number")
    number.fill("0.3")
    number.press("Tab")
    assert rig.asked("effect") == []  # off is off
    row.get_by_role("switch").check()
    until(lambda: rig.acting == {"base.lag_v": {"tau": 0.3}}, "it acts with its size")
    number.fill("7")
    number.press("Tab")
    until(lambda: rig.acting == {"base.lag_v": {"tau": 3.0}}, "cut to its bound")
    slider = row.get_by_role("slider")
    slider.focus()
    slider.press("Home")
    until(lambda: rig.acting == {"base.lag_v": {"tau": 0.0}}, "the slider's other end")
    page.locator("#effects-off").click()
    until(lambda: rig.acting == {}, "all off")
    expect(row.get_by_role("switch")).not_to_be_checked()


def test_a_slider_on_a_slow_line_sends_what_is_newest_only(visit, shown):
    page, rig = visit.page, shown.rig
    page.locator("#tab-effects").click()
    page.locator("#effect-search").fill("base.lag_v")
    row = page.locator(".effect-row:visible")
    row.get_by_role("switch").check()
    until(lambda: rig.acting == {"base.lag_v": {"tau": 0.1}}, "on, with its typical size")
    rig.slow.set()
    slider = row.get_by_role("slider")
    for place in range(0, 1001, 40):
        slider.fill(str(place))
    assert len(rig.asked("effect")) <= 2
    rig.slow.clear()
    until(lambda: rig.acting.get("base.lag_v") == {"tau": 3.0}, "the last one")
    assert len(rig.asked("effect")) == 3


def test_what_acts_is_saved_as_a_model_file(visit):
    page = visit.page
    page.locator("#tab-effects").click()
    with page.expect_download() as download:
        page.locator("#save-model").click()
    assert download.value.suggested_filename == "model.yaml"
    assert download.value.path().read_text() == "name: made up\neffects: []\n"


def test_a_body_is_placed_by_numbers(visit, shown):
    page = visit.page
    page.locator("#tab-body").click()
    page.locator("#body-select").select_option(label="<b>box</b> (obstacle)")
    for name, value in (("x", "0.5"), ("y", "-1.25"), ("yaw", "90")):
        page.locator(f"#place-{name}").fill(value)
    page.locator("#place-yaw").press("Enter")
    until(lambda: shown.rig.poses["2"] == pytest.approx((0.5, -1.25, math.pi / 2)), "placed")
    expect(page.locator("#toast")).to_have_text("<b>box</b> was moved there.")


def test_the_form_follows_the_body_until_somebody_types(visit, shown):
    page = visit.page
    page.locator("#tab-body").click()
    page.locator("#body-select").select_option(label="<b>box</b> (obstacle)")
    shown.rig.poses["2"] = (0.75, 1.5, 0.0)
    expect(page.locator("#place-x")).to_have_value("0.750")
    page.locator("#place-y").fill("2")
    shown.rig.poses["2"] = (1.0, 1.25, 0.0)
    expect(page.locator("#body-pose")).to_have_text("1.000 m, 1.250 m, 0.0°")
    expect(page.locator("#place-x")).to_have_value("0.750")
    page.locator("#place button").click()
    until(lambda: shown.rig.poses["2"][:2] == (0.75, 2.0), "placed")
    shown.rig.poses["2"] = (-1.5, 1.25, 0.0)
    expect(page.locator("#place-x")).to_have_value("-1.500")


def test_the_seed_that_is_shown_is_that_of_the_run(visit, shown):
    seed = visit.page.locator("#seed")
    expect(seed).to_have_value("42")
    seed.fill("7")
    visit.page.locator("#reseed").click()
    until(lambda: shown.rig.seed == 7, "started again")
    expect(seed).to_have_value("7")
    shown.rig.seed = 9  # somebody else's
    expect(seed).to_have_value("9")


def test_toolbar_and_legend_cover_nothing_at_first(visit):
    bars = [visit.page.locator("[aria-label=View]").bounding_box(), visit.page.locator("#front").bounding_box()]
    assert visit.spot(0, HALF)[1] > bars[0]["y"] + bars[0]["height"]
    assert visit.spot(0, -HALF)[1] < bars[1]["y"] + bars[1]["height"] - LEGEND


def test_recording_and_estimate(visit, shown):
    page = visit.page
    shown.rig.slow.set()
    page.locator("#record").click()
    expect(page.locator("#record")).to_have_text("Starting to record")
    expect(page.locator("#record")).to_be_disabled()
    shown.rig.slow.clear()
    expect(page.locator("#record")).to_have_text("Stop recording made_up.bag")
    expect(page.locator("#toast")).to_have_text("recording")
    page.locator("#estimate").click()
    drag(visit, (0.0, 0.0), (0.0, 1.0))
    asked = until(lambda: shown.rig.asked("initial_pose"), "an estimate")[0]
    assert near((asked["x"], asked["y"], asked["yaw"]), 0.0, 0.0, math.pi / 2)
    expect(page.locator("#estimate")).to_have_attribute("aria-pressed", "false")


def test_follow_keeps_the_chair_in_the_middle(visit, shown):
    page = visit.page
    page.keyboard.press("f")
    expect(page.locator("#follow")).to_have_attribute("aria-pressed", "true")
    shown.rig.poses["1"] = (-3.0, -3.0, 0.0)
    page.locator("#tab-body").click()
    page.wait_for_function("document.getElementById('read-t')")
    page.mouse.click(*visit.spot(0.0, 0.0))
    expect(page.locator("#body-select option:checked")).to_have_text("chair (robot)")
