# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's page in a real browser: what it shows, to whom, and how well it can be read."""

import re

import pytest
from playwright.sync_api import expect
from viewer_page_rig import BAG, HOSTILE, Shown, Visit, until

from kurumaisu.viewer.server import PAGE

PHONE = {"viewport": {"width": 360, "height": 740}, "has_touch": True, "is_mobile": True}
TABS = ("effects", "view", "body", "notes")


@pytest.fixture(scope="module")
def shown():
    with Shown(robots=3) as one:
        yield one


@pytest.fixture(scope="module")
def look(browser, shown):
    """A page for all that only look at it: each load costs a second on a busy machine."""
    with Visit(browser, shown.link, reduced_motion="reduce") as visit:
        yield visit


def show_tab(page, name):
    page.locator(f"#tab-{name}").click()
    expect(page.locator(f"#panel-{name}")).to_be_visible()


def test_it_says_what_it_shows(look):
    page = look.page
    expect(page).to_have_title("made up - kurumaisu")
    assert "token" not in page.url  # it must not stay in the history
    expect(page.locator("#mode")).to_have_text("simulator")
    expect(page.locator("#read-vw")).to_have_text("0.50 m/s, 0.25 rad/s")
    expect(page.locator("#read-volts")).to_have_text("0.500 V, 0.200 V")
    before = page.locator("#read-t").text_content()
    expect(page.locator("#read-t")).not_to_have_text(before)  # it goes on
    expect(page.locator("#effect-count")).to_have_text(re.compile(r"^\d\d effects, 0 on$"))


def test_every_module_is_asked_for_at_once():
    """Over a slow tunnel each level of imports costs a round trip."""
    html = (PAGE / "index.html").read_text()
    named = set(re.findall(r'(?:modulepreload" href|script type="module" src)="page/([\w./]+)"', html))
    of_the_report = {"report/report.js"}  # the critic's report, which is another page
    assert named == {path.relative_to(PAGE).as_posix() for path in PAGE.rglob("*.js")} - of_the_report


def test_nothing_of_the_page_is_inline_or_foreign():
    text = "".join(path.read_text() for path in PAGE.rglob("*.*"))
    assert not re.search(
        r"<style|\sstyle=|\son\w+=\"|innerHTML|outerHTML|insertAdjacentHTML|document\.write|eval\(", text
    )
    assert set(re.findall(r"https?://[\w./]+", text)) == {"http://www.w3.org/2000/svg"}  # a name, not an address


def test_names_are_shown_as_text(look):
    page = look.page
    show_tab(page, "body")
    page.locator("#body-select").select_option(label=f"{HOSTILE} (obstacle)")
    expect(page.locator("#body-pose")).to_have_text("2.500 m, −2.500 m, 0.0°")
    show_tab(page, "notes")
    expect(page.locator("#notes li")).to_have_text(f"warning MADE_UP {HOSTILE}")
    assert page.locator("img, b").count() == 0


def interactive(page):
    """Return (role, name) of what can be used, as a screen reader has it."""
    session = page.context.new_cdp_session(page)
    nodes = session.send("Accessibility.getFullAXTree")["nodes"]
    roles = {
        "button",
        "checkbox",
        "switch",
        "radio",
        "slider",
        "combobox",
        "textbox",
        "searchbox",
        "spinbutton",
        "tab",
        "link",
    }
    seen = [node for node in nodes if not node["ignored"]]
    return [(node["role"]["value"], node["name"]["value"].strip()) for node in seen if node["role"]["value"] in roles]


def test_every_control_has_a_name_and_can_be_reached_by_keys(look):
    page = look.page
    for name in TABS:
        show_tab(page, name)
        if name == "effects":
            page.locator("#effect-search").fill("base.sign")
            page.locator("summary:visible").click()
        found = interactive(page)
        assert len(found) > 15
        assert [role for role, text in found if not text] == []
    unreachable = page.evaluate("""[...document.querySelectorAll('button, input, select, a, summary')].filter(
        (one) => one.checkVisibility() && one.tabIndex < 0 && one.role !== 'tab').map((one) => one.id)""")
    assert unreachable == []
    show_tab(page, "view")
    page.keyboard.press("ArrowRight")  # tabs are one stop of Tab; arrows go on
    expect(page.locator("#panel-body")).to_be_visible()
    expect(page.locator("#tab-body")).to_be_focused()
    assert page.locator("#connection[role=status], #toast[role=status], #alarm[role=alert]").count() == 3


CONTRAST = """() => {
  const numbers = (color) => color.match(/[\\d.]+/g).map(Number);
  const light = (color) => {
    const linear = (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
    const [r, g, b] = numbers(color).map((v) => linear(v / 255));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ground = (one) => {
    for (let place = one; place; place = place.parentElement) {
      const color = getComputedStyle(place).backgroundColor;
      if ((numbers(color)[3] ?? 1) > 0.99) return color;
    }
    return 'rgb(255, 255, 255)';
  };
  const weak = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const one = walker.currentNode.parentElement;
    if (!walker.currentNode.data.trim() || !one.checkVisibility({visibilityProperty: true})) continue;
    const [a, b] = [light(getComputedStyle(one).color), light(ground(one))].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    if (ratio < 4.5) weak.push(`${ratio.toFixed(2)} ${one.id} ${one.className} ${walker.currentNode.data}`);
  }
  return weak;
}"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_all_text_has_the_contrast_of_wcag_aa(look, scheme):
    page = look.page
    page.emulate_media(color_scheme=scheme)
    page.locator("#pause").hover()
    for name in TABS:
        show_tab(page, name)
        assert page.evaluate(CONTRAST) == []
    page.locator("#help").click()
    assert page.evaluate(CONTRAST) == []
    page.keyboard.press("Escape")


def test_the_switch_of_colours_beats_the_systems(browser, shown):
    with Visit(browser, shown.link, color_scheme="dark") as visit:
        page = visit.page
        ground = "() => getComputedStyle(document.body).backgroundColor"
        dark = page.evaluate(ground)
        page.locator("#theme").click()
        expect(page.locator("#theme")).to_have_text("Light")
        assert page.evaluate(ground) == "rgb(255, 255, 255)" != dark
        page.reload()
        expect(page.locator("#theme")).to_have_text("Light")


def test_a_phone_has_no_sideways_scrolling_and_the_stop_in_sight(browser, shown):
    with Visit(browser, shown.link, **PHONE) as visit:
        page = visit.page
        page.locator("#more").tap()
        for name in TABS:
            page.locator(f"#tab-{name}").tap()
            expect(page.locator(f"#panel-{name}")).to_be_visible()
            widest = page.evaluate("""Math.max(...[...document.querySelectorAll('body *:not(.unseen)')].filter(
                (one) => one.checkVisibility()).map((one) => one.getBoundingClientRect().right))""")
            assert widest <= 360.5
            assert page.evaluate("document.scrollingElement.scrollWidth") <= 360
            expect(page.locator("#estop")).to_be_in_viewport(ratio=1)
        page.locator("#close").tap()
        expect(page.locator(".panel:visible")).to_have_count(0)


def test_a_robot_that_may_only_be_seen_looks_like_it(browser):
    with Shown(control=False, mode="robot", abilities=frozenset()) as shown, Visit(browser, shown.link) as visit:
        page = visit.page
        expect(page.locator("#banner")).to_contain_text("View only")
        expect(page.locator("#estop")).to_be_disabled()
        expect(page.locator("#estop")).to_have_attribute("title", re.compile("View only"))
        for name in ("pause", "drive", "record", "tab-effects", "estimate", "scrubber"):
            expect(page.locator(f"#{name}")).to_be_hidden()
        x, y = visit.spot(-1.0, 1.0)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 100, y, steps=3)
        page.mouse.up()
        page.keyboard.press("p")
        page.keyboard.press("t")
        page.keyboard.press("Space")
        before = page.locator("#read-t").text_content()
        expect(page.locator("#read-t")).not_to_have_text(before)
        assert shown.rig.commands == []


def test_without_a_token_controls_say_how_to_get_one(browser, shown):
    with Visit(browser, shown.server.address) as visit:
        expect(visit.page.locator("#banner")).to_contain_text("the link that the viewer printed at its start.")
        expect(visit.page.locator("#banner-copy")).to_be_hidden()
        expect(visit.page.locator("#pause")).to_be_disabled()
        show_tab(visit.page, "effects")
        expect(visit.page.locator("[role=switch]").first).to_be_disabled()


def test_the_command_that_lets_one_take_control_can_be_copied(browser, shown):
    shown.hub.new_token, before = "rosservice call /viewer_node/new_token", shown.hub.new_token
    try:
        with Visit(browser, shown.server.address, permissions=["clipboard-read", "clipboard-write"]) as visit:
            expect(visit.page.locator("#banner-command")).to_have_text(shown.hub.new_token)
            visit.page.locator("#banner-copy").click()
            expect(visit.page.locator("#toast")).to_have_text("The command was copied.")
            assert visit.page.evaluate("navigator.clipboard.readText()") == shown.hub.new_token
    finally:
        shown.hub.new_token = before


def test_odometry_does_not_look_like_a_reading_that_is_too_long():
    odom = re.search(r"--odom: light-dark\(#(\w{6}), #(\w{6})\)", (PAGE / "style.css").read_text())
    long = re.search(r"LONG = \{light: \[([\d, ]+)\], dark: \[([\d, ]+)\]\}", (PAGE / "picture/colors.js").read_text())
    for one, other in zip(odom.groups(), long.groups(), strict=True):
        pairs = zip(bytes.fromhex(one), map(int, other.split(",")), strict=True)
        assert sum((a - b) ** 2 for a, b in pairs) > 70**2


def test_a_recording_is_scrubbed(browser):
    with Shown(mode="bag", abilities=BAG) as shown, Visit(browser, f"{shown.link}&t=110.5&x=-1&y=1") as visit:
        page, rig = visit.page, shown.rig
        expect(page.locator("#moment")).to_have_text("10.50 of 60.00 s")  # where the address led
        page.locator("#scrubber").fill("123")
        until(lambda: rig.playback.t == 123.0, "seek")
        expect(page.locator("#moment")).to_have_text("23.00 of 60.00 s")
        page.locator("#front").focus()
        page.keyboard.press(",")
        until(lambda: abs(rig.playback.t - 122.9) < 1e-9, "0.1 s back")
        page.keyboard.press("p")
        until(lambda: rig.playback.playing, "play")
        expect(page.locator("#play")).to_have_text("Pause")
        expect(page.locator("#estop")).to_be_hidden()
