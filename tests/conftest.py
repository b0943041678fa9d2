# SPDX-License-Identifier: BSD-3-Clause
"""For all tests."""

import hypothesis
import pytest

# How long an example takes is the machine's business: a busy one is no failure.
hypothesis.settings.register_profile("any machine", deadline=None)
hypothesis.settings.load_profile("any machine")


@pytest.fixture(scope="module")
def browser():
    """A headless browser, for the tests of a module that ask for one."""
    from playwright.sync_api import sync_playwright
    from viewer_page_rig import open_browser

    with sync_playwright() as playwright:
        one = open_browser(playwright)
        yield one
        one.close()


@pytest.fixture
def running():
    """The viewer's server, with a rig behind it."""
    from viewer_rig import Running

    with Running() as one:
        yield one


@pytest.fixture
def page(running):
    """A client of it, which may only look."""
    from kurumaisu.bench.speed.viewer.page import Page

    one = Page(running.server.address)
    yield one
    one.close()


@pytest.fixture
def driver(running, page):
    """The client, with control."""
    page.let_in(running.server.new_address())
    return page


@pytest.fixture
def shown():
    """What the viewer's page is to show: a rig that is paused, behind a server."""
    from viewer_page_rig import Shown

    with Shown() as one:
        one.rig.paused = True
        yield one


@pytest.fixture
def visit(browser, shown):
    """A page that may command it."""
    from playwright.sync_api import expect
    from viewer_page_rig import Visit

    with Visit(browser, shown.link) as one:
        expect(one.page.locator("#drive")).to_be_enabled()
        yield one


@pytest.fixture
def two_runs(tmp_path):
    """A recording of two drives in a room."""
    from view_rig import LASER, ROOM, drive, meta

    from kurumaisu.critic.data.csv_writer import write_csv_run

    (tmp_path / "room.world").write_text(ROOM)
    meta(tmp_path, world="room.world", laser=LASER)
    for run in (drive("early", 10.0), drive("late", 5000.0)):
        write_csv_run(tmp_path / run.name, run)
    return tmp_path
