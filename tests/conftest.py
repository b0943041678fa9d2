# SPDX-License-Identifier: BSD-3-Clause
"""For all tests; with --quick, those that compute little only.

How many seconds of the processor each test took is kept in .ws; --quick skips those known to take long, and stops
others when they do.
"""

import contextlib
import json
import signal
import time
from pathlib import Path

import hypothesis
import pytest

LONG = 0.3  # [s] of the processor, setup and teardown included: with --quick no test gets more
TIMES = Path(__file__).resolve().parents[1] / ".ws/log/times.json"
TOOK = {}  # [s] by name, of this session

# How long an example takes is the machine's business: a busy one is no failure.
hypothesis.settings.register_profile("any machine", deadline=None)
hypothesis.settings.load_profile("any machine")


def pytest_addoption(parser):
    parser.addoption("--quick", action="store_true", help=f"skip tests that compute for more than {LONG} s")


def pytest_collection_modifyitems(config, items):
    if config.getoption("quick"):
        known = _times()
        for item in items:
            if known.get(item.name, 0.0) > LONG:
                item.add_marker(pytest.mark.skip(reason=f"took {known[item.name]} s"))


_TOO_LONG = f"takes more than {LONG} s"


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item):
    """Skip what was interrupted, whatever a library made of it."""
    report = (yield).get_result()
    if report.failed and getattr(item, "is_over", False):
        report.outcome, report.longrepr = "skipped", (str(item.path), item.location[1], _TOO_LONG)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_setup(item):
    item.begun = time.process_time()
    with _limited(item):
        yield


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_call(item):
    with _limited(item):
        yield


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_teardown(item):
    yield
    item.user_properties.append(("cpu", round(time.process_time() - item.begun, 2)))


def pytest_runtest_logreport(report):
    took = dict(report.user_properties).get("cpu")
    if report.when == "teardown" and took:  # none if it was skipped
        TOOK[report.nodeid.split("::", 1)[1]] = took


def pytest_sessionfinish(session):
    """Keep the times, once where several processes ran the tests."""
    if TOOK and TIMES.parent.exists() and not hasattr(session.config, "workerinput"):
        TIMES.write_text(json.dumps({**_times(), **TOOK}))


def _times():
    try:
        return json.loads(TIMES.read_text())
    except (OSError, ValueError):
        return {}


@contextlib.contextmanager
def _limited(item):
    """Let --quick skip a test that computes for long."""

    def over(*_):
        item.is_over = True
        raise pytest.skip.Exception(_TOO_LONG)

    if item.config.getoption("quick"):
        signal.signal(signal.SIGPROF, over)
        signal.setitimer(signal.ITIMER_PROF, LONG)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


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

    from kurumaisu.critic.data.csv_reader import write_csv_run

    (tmp_path / "room.world").write_text(ROOM)
    meta(tmp_path, world="room.world", laser=LASER)
    for run in (drive("early", 10.0), drive("late", 5000.0)):
        write_csv_run(tmp_path / run.name, run)
    return tmp_path
