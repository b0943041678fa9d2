# SPDX-License-Identifier: BSD-3-Clause
"""The scripted driver: passes every waypoint of a route, and says when it is done."""

import numpy as np
import pytest

from kurumaisu._core import integrate
from kurumaisu.driving import Manner, PoseFollower, Route, RouteFollower, load_route
from kurumaisu.errors import Error
from kurumaisu.geometry import wrap
from kurumaisu.params import shipped
from kurumaisu.sim.chair.joystick import joystick

ROUTE = Route(np.array([[2.0, 0.0], [2.0, 2.0], [-1.0, 2.0]]), 0.5, 0.8, 1.5, 0.2, 1.0, 60.0)


def follow(route, pose, seconds):
    driver, path = RouteFollower(route), [np.array(pose)]
    for _ in range(round(seconds / 0.05)):
        v, w = driver.command(path[-1])
        path.append(integrate(np.array([v]), np.array([w]), np.array([0.05]), list(path[-1]))[-1])
    return driver, np.array(path)


@pytest.mark.parametrize("heading", [0.0, 2.0, np.pi, -2.0, 7.0])
def test_every_waypoint_is_passed_from_any_heading(heading):
    driver, path = follow(ROUTE, [0.0, 0.0, heading], 40.0)
    assert driver.done
    for waypoint in ROUTE.waypoints:
        assert np.hypot(*(path[:, :2] - waypoint).T).min() < ROUTE.reach
    assert driver.command(path[-1]) == (0.0, 0.0)


def test_limits_of_the_route_hold():
    driver = RouteFollower(ROUTE)
    for heading in np.linspace(-np.pi, np.pi, 41):
        v, w = driver.command(np.array([0.0, 0.0, heading]))
        assert 0.0 <= v <= ROUTE.speed
        assert abs(w) <= ROUTE.turn


def test_the_shipped_route_starts_at_the_chair_and_stays_in_the_building():
    route = load_route(shipped("launch/round.yaml"))
    driver, path = follow(route, [1.0, 1.0, 0.0], route.deadline)
    assert driver.done
    assert (path[:, :2] > 0.3).all()
    assert (path[:, 0] < 11.7).all()
    assert (path[:, 1] < 8.7).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("waypoints: []\n", "waypoints: must name at least one point"),
        ("waypoints: [{x: 1.0}]\n", r"waypoints\[0\].y: is missing"),
        ("waypoints: [{x: 1.0, y: 0.0}]\nspeed: 0.0\n", "speed: must be a finite number above 0"),
    ],
)
def test_a_bad_route_is_refused_by_key(tmp_path, text, message):
    path = tmp_path / "route.yaml"
    path.write_text(text)
    with pytest.raises(Error, match=message):
        load_route(path)


def test_joystick_excites_everything_and_ends_at_rest():
    commands = joystick(120.0, np.random.default_rng(1))
    assert (np.diff(commands[:, 0]) > 0).all()
    assert commands[-1].tolist() == [120.0, 0.0, 0.0]
    v, w = commands[:, 1], commands[:, 2]
    assert min((v > 0).mean(), (w > 0).mean(), (w < 0).mean()) > 0.2
    assert (v < 0).any()
    assert (v[:-1] == 0).any()


MANNER = Manner(gain=1.0, reach=0.05, aim=0.035, patience=8.0)


def seek(goal, pose, seconds, period=0.05):
    """Return the driver and the path [m, m, rad] to a goal."""
    driver, path = PoseFollower(np.array(goal), MANNER, 0.5, 0.8), [np.array(pose)]
    for step in range(round(seconds / period)):
        v, w = driver.command(path[-1], step * period)
        assert 0.0 <= v <= 0.5
        assert abs(w) <= 0.8
        path.append(integrate(np.array([v]), np.array([w]), np.array([period]), list(path[-1]))[-1])
    return driver, np.array(path)


@pytest.mark.parametrize("heading", [0.0, 2.0, np.pi, -2.0, 7.0])
@pytest.mark.parametrize("goal", [(2.0, 1.0, -2.5), (-1.0, 0.0, 3.1), (0.0, 0.0, 1.0)])
def test_a_pose_is_reached_from_any_heading(goal, heading):
    driver, path = seek(goal, [0.0, 0.0, heading], 40.0)
    assert driver.done
    assert not driver.gave_up(40.0) or driver.done
    assert np.hypot(*(path[-1, :2] - goal[:2])) < 2 * MANNER.reach
    assert abs(wrap(path[-1, 2] - goal[2])) < MANNER.aim
    assert (path[-1] == path[-20]).all()  # it rests there


def test_who_comes_no_closer_gives_up():
    driver, stuck = PoseFollower(np.array([3.0, 0.0, 0.0]), MANNER, 0.5, 0.8), np.array([0.0, 0.0, 0.0])
    for now in np.arange(0.0, 8.0, 0.1):
        driver.command(stuck, now)
        assert not driver.gave_up(now)
    driver.command(stuck, 8.2)
    assert driver.gave_up(8.2)
    assert not driver.done
