# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's page in a real browser: numbers, from the wire to the picture and from a slider's place to a value."""

import base64
import io
import math

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect
from viewer_page_rig import Shown, Visit, until

from kurumaisu.viewer import Fan, protocol


@pytest.fixture(scope="module")
def shown():
    with Shown(robots=3) as one:
        yield one


def show_tab(page, name):
    page.locator(f"#tab-{name}").click()
    expect(page.locator(f"#panel-{name}")).to_be_visible()


def image_of(page):
    with page.expect_download() as download:
        page.locator("#screenshot").click()
    return np.asarray(Image.open(io.BytesIO(download.value.path().read_bytes())).convert("RGB")).astype(int)


def test_a_saved_picture_shows_the_sign_of_range_errors(browser, shown):
    with Visit(browser, shown.link, color_scheme="light") as visit:
        page = visit.page
        show_tab(page, "view")
        for layer in ("odom", "estimate", "trails", "truth", "bodies", "names", "particles", "marks"):
            page.locator(f"[data-layer={layer}]").uncheck()
        redder = {}
        try:
            for size in (-0.15, 0.15):
                shown.rig.effects["laser.offset"] = (True, size)
                t = shown.rig.t
                page.wait_for_function(
                    "(t) => parseFloat(document.getElementById('read-t').textContent) > t", arg=t + 0.1
                )
                picture = image_of(page)
                legend_free = picture[:-100]
                redder[size] = np.sum(legend_free[..., 0] > legend_free[..., 2] + 80)
        finally:
            shown.rig.effects["laser.offset"] = (False, 0.0)
        box = page.locator("#front").bounding_box()
        assert picture.shape[:2] == (round(box["height"]), round(box["width"]))
        assert redder[0.15] > redder[-0.15] + 300


def test_a_map_lies_where_its_origin_and_resolution_say(browser):
    greys = np.full((40, 60), 254, np.uint8)
    greys[:20, :30] = 0  # the upper left quarter is occupied
    greys[20:, 30:] = 205  # the lower right one is unknown
    file = io.BytesIO()
    Image.fromarray(greys).save(file, "PNG")
    with Shown(mode="robot") as shown, Visit(browser, shown.server.address, color_scheme="light") as visit:
        shown.hub.map(file.getvalue(), 60, 40, 0.1, (2.0, -3.0, math.pi / 2))  # its first axis points up
        page = visit.page
        show_tab(page, "view")
        for box in page.locator("[data-layer]:not([data-layer=map])").all():
            box.uncheck()
        corner = page.locator("#front").bounding_box()

        def shade(picture, x, y):
            px, py = visit.spot(x, y)
            return picture[round(py - corner["y"]), round(px - corner["x"])].tolist()

        outside = shade(image_of(page), -3.0, 0.0)
        assert outside == [255, 255, 255]
        until(lambda: sum(shade(image_of(page), -1.0, -1.5)) < 400, "a wall")
        picture = image_of(page)
        assert shade(picture, 1.0, 1.5) == outside
        assert outside != shade(picture, 1.0, -1.5) == shade(picture, -1.0, 1.5)


def test_binary_messages_are_read_as_they_were_written(browser, shown):
    ranges = np.array([np.nan, np.inf, 0.02, 4.095], "f4")
    fan = Fan((1.0, 2.0, 3.0), -2.0, 0.1, 0.0625, 4.0, ranges, None, np.arange(4.0))
    packed = [protocol.scan(fan, (7, 2)), protocol.scan(fan, (-1, 0)), protocol.particles([(1.0, 2.0, 0.5)])]
    with Visit(browser, shown.server.address) as visit:
        scan, nobody, cloud = visit.page.evaluate(
            """async (texts) => {
              const {decode} = await import('/page/server/decode.js');
              const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
              const plain = (value) => value instanceof Float32Array ? [...value].map(String) : value;
              const entries = (text) => Object.entries(decode(bytes(text)));
              return texts.map((text) => Object.fromEntries(entries(text).map(([k, v]) => [k, plain(v)])));
            }""",
            [base64.b64encode(one).decode() for one in packed],
        )
    assert [scan[key] for key in ("kind", "body", "ranger", "count", "x", "yaw", "rangeMin", "rangeMax")] == [
        "scan",
        7,
        2,
        4,
        1,
        3,
        0.0625,
        4,
    ]
    assert scan["ranges"][:2] == ["NaN", "Infinity"]
    assert float(scan["ranges"][3]) == pytest.approx(4.095)
    assert scan["errors"] is None
    assert scan["intensities"] == ["0", "1", "2", "3"]
    assert nobody["body"] is None
    assert cloud["values"] == ["1", "2", "0.5"]


BOUNDS = [(-0.9, 4.0), (0.0, 3.0), (-60.0, 60.0), (0.001, 30.0), (-2.0, -1.0)]


def test_a_slider_reaches_both_bounds_and_is_fine_near_zero(browser, shown):
    with Visit(browser, shown.server.address) as visit:
        found = visit.page.evaluate(
            """async (all) => {
              const {law} = await import('/page/panels/slider.js');
              const places = Array.from({length: 101}, (_, i) => 10 * i);
              return all.map(([low, high]) => {
                const one = law(low, high);
                const values = places.map(one.value);
                return [values.map(one.place), values];
              });
            }""",
            BOUNDS,
        )
    for bounds, (places, values) in zip(BOUNDS, found, strict=True):
        assert (values[0], values[-1]) == bounds
        assert np.all(np.diff(values) > 0)
        assert places == pytest.approx(np.arange(101) * 10, abs=3.0)
        if bounds[0] <= 0 <= bounds[1]:
            assert np.min(np.diff(values)) < 0.001 * (bounds[1] - bounds[0])  # evenly it would be 0.01
