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
