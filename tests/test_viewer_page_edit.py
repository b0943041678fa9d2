# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's page in a real browser: what is added to the world, deleted from it and moved, and undone."""

import math

import pytest
from playwright.sync_api import expect
from test_viewer_page_control import BOX, drag, near
from viewer_page_rig import until


def names(visit):
    return visit.page.locator("#body-select option").all_text_contents()


def added(shown, number=0):
    """Return the arguments of a command add, when it has come."""
    return until(lambda: shown.rig.asked("add")[number : number + 1], "something is added")[0]


@pytest.mark.parametrize(("tool", "end", "asked"), [
    ("box", None, {"x": 0.5, "y": 2.0, "yaw": 0.0, "length": 0.5, "width": 0.5}),
    ("box", (1.7, 1.2), {"x": 1.1, "y": 1.6, "yaw": 0.0, "length": 1.2, "width": 0.8}),
    ("wall", (0.5, 3.0), {"x": 0.5, "y": 2.5, "yaw": math.pi / 2, "length": 1.0, "width": 0.1}),
    ("person", None, {"x": 0.5, "y": 2.0, "yaw": 0.0, "length": 0.45, "width": 0.45}),
    ("person", (-1.5, 2.0), {"x": 0.5, "y": 2.0, "yaw": math.pi, "length": 0.45, "width": 0.45, "to_x": -1.5,
                             "to_y": 2.0}),
])  # fmt: skip
def test_a_tool_adds_what_is_drawn(visit, shown, tool, end, asked):
    page, start = visit.page, (0.5, 2.0)
    page.locator(f"#{tool}").click()
    if end is None:
        page.mouse.click(*visit.spot(*start))
    else:
        drag(visit, start, end)
    given = added(shown)
    assert given.pop("kind") == tool
    assert {key: abs(value) if key == "yaw" else value for key, value in given.items()} == pytest.approx(
        asked, abs=0.02
    )
    expect(page.locator("#body-select option:checked")).to_have_text(f"{tool} 91 (obstacle)")
    page.keyboard.press("Escape")
    expect(page.locator(f"#{tool}")).to_have_attribute("aria-pressed", "false")
    assert shown.rig.asked("set_pose") == []


def test_add_move_delete_and_all_of_it_undone_and_redone(visit, shown):
    page, rig = visit.page, shown.rig
    expect(page.locator("#undo")).to_be_disabled()
    page.locator("#box").click()
    page.mouse.click(*visit.spot(0.5, 2.0))
    added(shown)
    page.keyboard.press("Escape")
    drag(visit, (0.5, 2.0), (1.5, 2.5))
    until(lambda: near(rig.poses["#91"], 1.5, 2.5, 0.0), "it was dragged")
    page.mouse.click(*visit.spot(*BOX))
    expect(page.locator("#body-select option:checked")).to_have_text("<b>box</b> (obstacle)")
    page.keyboard.press("Delete")
    until(lambda: rig.gone == {"2"}, "the rig's own box is gone")
    expect(page.locator("#body-select option:checked")).to_have_text("none")
    for button, gone, pose in (
        ("Control+z", set(), (1.5, 2.5)),
        ("Control+z", set(), (0.5, 2.0)),
        ("Control+z", {"#91"}, None),
        ("Control+y", set(), None),
        ("Control+Shift+Z", set(), (1.5, 2.5)),
        ("Control+y", {"2"}, (1.5, 2.5)),
    ):
        page.keyboard.press(button)
        until(lambda gone=gone: rig.gone == gone, f"{button}: {gone} gone")
        if pose is not None:
            until(lambda pose=pose: near(rig.poses["#91"], *pose, 0.0), f"{button}: it is at {pose}")
    expect(page.locator("#redo")).to_be_disabled()
    expect(page.locator("#undo")).to_have_attribute("title", "Undo (Ctrl Z): deleting <b>box</b>")
    assert len(rig.asked("add")) == 1  # the rest were ways back


def test_what_is_refused_is_no_step(visit, shown):
    page = visit.page
    page.locator("#box").click()
    page.mouse.click(*visit.spot(4.2, 0.0))
    expect(page.locator("#alarm")).to_have_text("box 1: would stand in a wall")
    expect(page.locator("#undo")).to_be_disabled()


@pytest.mark.parametrize("by_this_page", [True, False])
def test_after_a_reset_all_can_be_done_again(visit, shown, by_this_page):
    page, rig = visit.page, shown.rig
    page.locator("#wall").click()
    page.mouse.click(*visit.spot(0.0, -2.0))
    expect(page.locator("#body-select option:checked")).to_have_text("wall 91 (obstacle)")
    page.keyboard.press("Escape")
    if by_this_page:
        page.locator("#reset").click()
    else:
        rig.do_reset()
    expect(page.locator("#undo")).to_be_disabled()
    assert "wall 91 (obstacle)" not in names(visit)
    page.locator("#redo").click()
    assert added(shown, 1) == added(shown, 0)
    until(lambda: list(rig.added) == ["#91"], "the wall is there again")
    page.locator("#undo").click()
    until(lambda: rig.gone == {"#91"}, "and gone")


def test_the_world_is_saved_as_a_file(visit):
    with visit.page.expect_download() as download:
        visit.page.locator("#save-world").click()
    assert download.value.suggested_filename == "saved.world"
    assert download.value.path().read_text() == "a world\n"
    expect(visit.page.locator("#toast")).to_have_text("The world was saved as it is at 1.000 s: 3 models.")


def test_turning_by_keys_is_one_step(visit, shown):
    page, rig = visit.page, shown.rig
    page.mouse.click(*visit.spot(*BOX))
    rig.slow.set()
    for _ in range(3):
        page.keyboard.press("[")
    rig.slow.clear()
    until(lambda: near(rig.poses["2"], *BOX, 0.3 + math.radians(15)), "turned by 15 degrees")
    expect(page.locator("#undo")).to_be_enabled()
    page.locator("#undo").click()
    until(lambda: near(rig.poses["2"], *BOX, 0.3), "as before")
    expect(page.locator("#undo")).to_be_disabled()
