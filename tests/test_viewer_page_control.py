# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's page in a real browser: what it commands, and that it stops when it should."""

import math
import threading

import pytest
from playwright.sync_api import expect, sync_playwright
from viewer_page_rig import Shown, Visit, open_browser, until

from kurumaisu.viewer import Outcome

PHONE = {"viewport": {"width": 390, "height": 780}, "has_touch": True, "is_mobile": True}
BOX = (-1.0, 1.0)  # where the rig's box stands
LIMIT = 0.5  # [m/s] of the rig; the page begins with half of it


@pytest.fixture(scope="module")
def browser():
    with sync_playwright() as playwright:
        one = open_browser(playwright)
        yield one
        one.close()


@pytest.fixture
def shown():
    with Shown() as one:
        one.rig.paused = True
        yield one


@pytest.fixture
def visit(browser, shown):
    with Visit(browser, shown.link) as one:
        expect(one.page.locator("#drive")).to_be_enabled()
        yield one


@pytest.fixture
def phone(browser, shown):
    with Visit(browser, shown.link, **PHONE) as one:
        expect(one.page.locator("#drive")).to_be_enabled()
        yield one


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
    box = visit.page.locator("#front").bounding_box()
    reach = math.hypot(0.25, 0.25) + 26 / (0.94 * min(box["width"], box["height"]) / 8)
    expect(visit.page.locator("#body-pose")).to_have_text("1.000 m, −1.000 m, 17.2°")
    drag(visit, (1.0 + reach * math.cos(0.3), -1.0 + reach * math.sin(0.3)), (1.0, 1.0))
    until(lambda: near(poses["2"], 1.0, -1.0, math.pi / 2), "the box is turned")


def test_a_place_that_is_refused_is_said_once(visit, shown):
    drag(visit, BOX, (4.3, 1.0))
    alarm = visit.page.locator("#alarm")
    expect(alarm).to_have_text("set_pose: 2 would stand in a wall")
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
    expect(page.locator("#effect-count")).to_have_text("1 of 59 effects, 0 on")
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
    expect(page.locator("#toast")).to_have_text("<b>box</b> was put there.")


def test_recording_and_estimate(visit, shown):
    page = visit.page
    page.locator("#record").click()
    expect(page.locator("#record")).to_have_text("Stop recording made_up.bag")
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


# The dead-man


def drives(shown):
    return [(one["v"], one["w"]) for one in shown.rig.asked("drive")]


def stopped(shown, visit):
    """Wait for the zero; then nothing more may come, for as long as four commands would have taken."""
    until(lambda: drives(shown)[-1] == (0.0, 0.0), "zero")
    count = len(drives(shown))
    visit.page.evaluate("() => new Promise((done) => setTimeout(done, 400))")
    assert len(drives(shown)) == count


def take_stick(visit):
    visit.page.locator("#drive").click()
    expect(visit.page.locator("#stick-box")).to_be_visible()


def test_keys_drive_while_they_are_held(visit, shown):
    page = visit.page
    page.locator("#front").focus()
    page.keyboard.down("w")
    page.keyboard.up("w")
    assert drives(shown) == []  # the stick has not been taken
    take_stick(visit)
    page.keyboard.down("ArrowUp")
    until(lambda: len(drives(shown)) >= 4, "it is repeated")
    assert set(drives(shown)) == {(LIMIT / 2, 0.0)}
    page.keyboard.down("a")
    until(lambda: drives(shown)[-1] == (LIMIT / 2, 0.4), "in a bend to the left")
    page.keyboard.up("a")
    page.keyboard.up("ArrowUp")
    stopped(shown, visit)


FRIGHTS = {
    "blur": "() => dispatchEvent(new Event('blur'))",
    "hidden": """() => {
        Object.defineProperty(document, 'hidden', {value: true, configurable: true});
        document.dispatchEvent(new Event('visibilitychange'));
    }""",
    "page left": "() => dispatchEvent(new Event('pagehide'))",
}


def test_the_stick_is_taken_away_when_nobody_may_be_there(visit, shown):
    page = visit.page
    for fright in FRIGHTS.values():
        take_stick(visit)
        page.keyboard.down("w")
        until(lambda: drives(shown) and drives(shown)[-1][0] > 0, "it drives")
        page.evaluate(fright)
        expect(page.locator("#alarm")).to_contain_text("The stick was taken away")
        stopped(shown, visit)
        expect(page.locator("#stick-box")).to_be_hidden()
        count = len(drives(shown))
        page.keyboard.down("w")  # as the repeats of a key that is still held
        expect(page.locator("#stick-box")).to_be_hidden()
        take_stick(visit)
        page.keyboard.down("w")  # nor does it drive when the stick is taken again: it must be let go first
        page.keyboard.press("Escape")
        expect(page.locator("#stick-box")).to_be_hidden()
        assert len(drives(shown)) == count
        page.keyboard.up("w")
        page.evaluate("() => { delete document.hidden; document.getElementById('alarm').textContent = ''; }")
        assert drives(shown)[-1] == (0.0, 0.0)


@pytest.mark.parametrize("key", ["x", "Space"])
def test_any_other_key_stops(visit, shown, key):
    take_stick(visit)
    visit.page.keyboard.down("w")
    until(lambda: len(drives(shown)) >= 2, "it drives")
    visit.page.keyboard.press(key)
    stopped(shown, visit)
    expect(visit.page.locator("#stick-box")).to_be_hidden()
    if key == "Space":
        until(lambda: shown.rig.estop, "the emergency stop too")


def test_a_lost_connection_lets_go_and_the_page_comes_back(browser, shown):
    with Visit(browser, shown.link) as visit:
        page = visit.page
        take_stick(visit)
        page.keyboard.down("w")
        until(lambda: len(drives(shown)) >= 2, "it drives")
        shown.server.close()
        expect(page.locator("#connection")).to_have_text("No connection: trying again")
        expect(page.locator("#stick-box")).to_be_hidden()
        expect(page.locator("#estop")).to_be_disabled()
        count = len(drives(shown))
        shown.start()
        expect(page.locator("#connection")).to_have_text("Connected", timeout=15_000)
        expect(page.locator("#banner")).to_contain_text("View only")  # another server's session is worth nothing
        page.evaluate("(hash) => { location.hash = hash; }", shown.link.split("#")[1])
        expect(page.locator("#drive")).to_be_enabled()
        expect(page.locator("#banner")).to_be_hidden()
        assert len(drives(shown)) == count  # nothing was sent that nobody held
        page.keyboard.up("w")
        visit.errors[:] = [one for one in visit.errors if "WebSocket connection" not in one]


def test_a_session_outlives_a_lost_connection(browser, shown):
    with Visit(browser, shown.link) as visit:
        expect(visit.page.locator("#drive")).to_be_enabled()
        visit.page.reload()
        expect(visit.page.locator("#drive")).to_be_enabled()


def test_nobody_drives_by_a_line_that_is_too_slow(visit, shown):
    jam = threading.Event()

    def late(v, w):
        jam.wait(10)
        return Outcome("driven")

    shown.rig.do_drive = late
    take_stick(visit)
    visit.page.keyboard.down("w")
    expect(visit.page.locator("#alarm")).to_contain_text("too slow to drive by")
    assert len(drives(shown)) <= 11
    jam.set()
    stopped(shown, visit)


# Fingers


class Fingers:
    """Touches, as the browser gets them."""

    def __init__(self, visit):
        self._session = visit.context.new_cdp_session(visit.page)

    def send(self, kind, *points):
        places = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)]
        self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})

    def drag(self, start, end):
        self.send("touchStart", start)
        for i in range(1, 6):
            self.send("touchMove", tuple(a + (b - a) * i / 5 for a, b in zip(start, end, strict=True)))
        self.send("touchEnd")


@pytest.mark.parametrize("end", ["touchEnd", "touchCancel"])
def test_a_finger_on_the_stick_drives_until_it_lifts(phone, shown, end):
    phone.page.locator("#drive").tap()
    box = phone.page.locator("#stick").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    fingers = Fingers(phone)
    fingers.send("touchStart", (x, y))
    fingers.send("touchMove", (x, y - 60))
    fingers.send("touchMove", (x, y - 500))  # beyond the rim is the rim
    until(lambda: drives(shown) and drives(shown)[-1] == pytest.approx((LIMIT / 2, 0.0)), "full speed")
    fingers.send(end)
    stopped(shown, phone)


def test_two_fingers_pinch(phone):
    x, y = phone.spot(*BOX)
    fingers = Fingers(phone)
    fingers.send("touchStart", (x - 30, y - 40), (x + 30, y - 40))
    for i in range(1, 6):
        fingers.send("touchMove", (x - 30 - 6 * i, y - 40), (x + 30 + 6 * i, y - 40))
    fingers.send("touchEnd")
    phone.page.locator("#tab-body").tap()
    expect(phone.page.locator("#body-select option:checked")).to_have_text("none")
    phone.page.locator("#close").tap()
    phone.page.touchscreen.tap(x, y + 40)  # twice as far from the middle of the fingers
    expect(phone.page.locator("#body-select option:checked")).to_have_text("<b>box</b> (obstacle)")


def test_a_finger_moves_what_was_tapped_before(phone, shown):
    fingers = Fingers(phone)
    fingers.drag(phone.spot(*BOX), phone.spot(0.0, 1.0))
    assert shown.rig.commands == []  # it moved the view, by 1 m to the right
    phone.page.touchscreen.tap(*phone.spot(0.0, 1.0))
    expect(phone.page.locator("#body-select option:checked")).to_have_text("<b>box</b> (obstacle)")
    fingers.drag(phone.spot(0.0, 1.0), phone.spot(1.0, 1.0))
    until(lambda: near(shown.rig.poses["2"], 0.0, 1.0, 0.3), "moved")
