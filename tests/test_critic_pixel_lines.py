# SPDX-License-Identifier: BSD-3-Clause
"""Straight walls are found again in their pixels, wherever they lie, and whatever is no stairs stays as it is."""

import numpy as np
import pytest

from kurumaisu.critic.ranges.scans.walls import straightened
from kurumaisu.world.bitmaps import outline

MIDDLES = np.arange(200) + 0.5
X, Y = np.meshgrid(MIDDLES, MIDDLES)


def turned(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s], [s, c]])


def box(degrees, half=(60.0, 30.0), middle=(100.3, 99.1)):
    """Pixels whose middles lie in a rectangle."""
    u, v = np.tensordot(turned(-degrees), np.stack([X - middle[0], Y - middle[1]]), 1)
    return (np.abs(u) < half[0]) & (np.abs(v) < half[1])


def corners(lines, degrees, middle=(100.3, 99.1)):
    return (lines[:, :2] - middle) @ turned(degrees)


@pytest.mark.parametrize("degrees", [2, 9, 17, 30, 45, 62, 88])
def test_the_sides_of_a_box_are_where_it_was_drawn_to_a_part_of_a_pixel(degrees):
    found = corners(straightened(outline(box(degrees))), degrees)
    away = np.minimum(np.abs(np.abs(found[:, 0]) - 60.0), np.abs(np.abs(found[:, 1]) - 30.0))
    assert away.max() < 0.3
    for x in (-60.0, 60.0):
        for y in (-30.0, 30.0):
            assert np.hypot(*(found - [x, y]).T).min() < 0.7


def test_a_map_without_stairs_stays_as_it_is_to_the_last_bit():
    drawn = np.zeros((200, 200), dtype=bool)
    drawn[20:180, 20:22] = drawn[20:22, 20:180] = drawn[60:90, 100:103] = True
    drawn[100, 100] = drawn[110:112, 100] = True
    segments = outline(drawn) * 0.05
    assert straightened(segments) is segments
    askew = np.array([[0.0, 0.0, 1.0, 0.3], [1.0, 0.3, 0.4, 2.0], [0.4, 2.0, 0.0, 0.0]])  # of no pixels
    assert straightened(askew) is askew
    assert not len(straightened(np.empty((0, 4))))


def test_what_stands_square_beside_an_askew_wall_stays_where_it_is():
    drawn = box(17, half=(40.0, 20.0))
    drawn[10, 20:100] = drawn[20:60, 5] = drawn[180:184, 180:184] = True
    lines = {tuple(line) for line in straightened(outline(drawn)).round(9).tolist()}
    square = np.zeros_like(drawn)
    square[10, 20:100] = square[20:60, 5] = square[180:184, 180:184] = True
    assert {tuple(line) for line in outline(square).tolist()} <= lines


@pytest.mark.parametrize("thick", [0.8, 1.6])
def test_a_thin_wall_keeps_both_of_its_sides(thick):
    lines = corners(straightened(outline(box(17, half=(60.0, thick)))), 17)
    long = np.abs(np.diff(np.vstack([lines, lines[:1]])[:, 0])) > 50
    sides = (lines[:, 1] + np.roll(lines[:, 1], -1))[long] / 2
    assert np.sort(sides) == pytest.approx([-thick, thick], abs=0.5)


def test_a_round_pillar_is_round():
    lines = straightened(outline(np.hypot(X - 100, Y - 100) < 30))
    middles = (lines[:, :2] + lines[:, 2:]) / 2 - 100
    assert np.hypot(*middles.T) == pytest.approx(30, abs=1.0)


def test_it_does_not_matter_how_a_map_is_turned_and_stretched():
    segments = outline(box(30))
    turn, stretch = turned(57), np.array([0.05, 0.02])
    there = (straightened(segments).reshape(-1, 2) * stretch @ turn.T + [3, -2]).reshape(-1, 4)
    here = straightened((segments.reshape(-1, 2) * stretch @ turn.T + [3, -2]).reshape(-1, 4))
    assert here == pytest.approx(there, abs=1e-9)
