# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's page in a real browser: it drives while somebody holds something, and fingers do what a mouse does."""

import math
import threading

import pytest
from playwright.sync_api import expect
from viewer_page_rig import Visit, until

from kurumaisu.viewer import Outcome

PHONE = {"viewport": {"width": 390, "height": 780}, "has_touch": True, "is_mobile": True}
BOX = (-1.0, 1.0)  # where the rig's box stands
LIMIT = 0.5  # [m/s] of the rig; the page begins with half of it


@pytest.fixture
def phone(browser, shown):
    with Visit(browser, shown.link, **PHONE) as one:
        expect(one.page.locator("#drive")).to_be_enabled()
        yield one


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
        expect(page.locator("#alarm")).to_contain_text("Driving was ended")
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


def test_space_stops_whatever_has_the_focus_while_the_stick_is_taken(visit, shown):
    take_stick(visit)
    visit.page.locator("#pause").focus()
    visit.page.keyboard.press("Space")
    until(lambda: shown.rig.estop, "emergency stop")
    expect(visit.page.locator("#estop")).to_have_attribute("aria-pressed", "true")
    assert [name for name, _ in shown.rig.commands] == ["estop"]  # the button was not pressed
    expect(visit.page.locator("#drive")).to_be_disabled()  # until it is released


def test_a_lost_connection_lets_go_and_the_page_comes_back(browser, shown):
    with Visit(browser, shown.link) as visit:
        page = visit.page
        take_stick(visit)
        page.keyboard.down("w")
        until(lambda: len(drives(shown)) >= 2, "it drives")
        shown.server.close()
        expect(page.locator("#connection")).to_have_text("No connection: retrying")
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
    expect(visit.page.locator("#alarm")).to_contain_text("too slow for driving")
    assert len(drives(shown)) <= 11
    jam.set()
    stopped(shown, visit)


# Fingers


def near(pose, x, y, yaw, tolerance=0.03):
    return math.hypot(pose[0] - x, pose[1] - y) < tolerance and abs(pose[2] - yaw) < tolerance


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
