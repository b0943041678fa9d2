# SPDX-License-Identifier: BSD-3-Clause
"""The battery: charge and energy are accounted for, and the circuit's equation holds."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from kurumaisu.sim.sensors.battery import Battery, BatterySettings, Load
from kurumaisu.sim.sensors.imu import STANDARD_GRAVITY
from kurumaisu.types import FloatArray

LOAD = Load(mass=120, inertia=15, idle=30, rolling=0.02, scrubbing=8, efficiency=0.7, recovery=0.4)
CURVE = np.array([[0.0, 21.0], [0.1, 23.5], [0.9, 25.5], [1.0, 26.4]])
BATTERY = BatterySettings(capacity=10.0, resistance=0.08, charge=0.8, curve=CURVE, load=LOAD)
REST = np.zeros((1, 3))


def speeds(*rows: tuple[float, float, float]) -> FloatArray:
    return np.array(rows)


@settings(deadline=None)
@given(v=st.floats(-2, 2), w=st.floats(-2, 2), before=st.floats(-2, 2), charge=st.floats(0.05, 1))
def test_voltage_times_current_is_the_power_asked_for(v: float, w: float, before: float, charge: float) -> None:
    start, end, dt = speeds((before, 0, 0)), speeds((v, 0, w)), 0.5
    reading = Battery(replace(BATTERY, charge=charge), start).read(end, dt)
    power = LOAD.power((start + end) / 2, (end - start) / dt)
    if not reading.exhausted[0]:
        np.testing.assert_allclose(-reading.current * reading.voltage, power, rtol=1e-12)
    source = np.interp(charge, *CURVE.T)
    np.testing.assert_allclose(reading.voltage, source + BATTERY.resistance * reading.current, rtol=1e-12)


def test_power_is_the_work_of_forces() -> None:
    np.testing.assert_allclose(LOAD.power(REST, REST), 30)
    steady = 0.02 * 120 * STANDARD_GRAVITY * 0.5
    np.testing.assert_allclose(LOAD.power(speeds((0.5, 0, 0)), REST), 30 + steady / 0.7)
    np.testing.assert_allclose(LOAD.power(speeds((-0.5, 0, 0)), REST), 30 + steady / 0.7)
    np.testing.assert_allclose(LOAD.power(speeds((0.5, 0, 0)), speeds((1, 0, 0))), 30 + (steady + 60) / 0.7)
    np.testing.assert_allclose(LOAD.power(speeds((0.5, 0, 0)), speeds((-1, 0, 0))), 30 + (steady - 60) * 0.4)
    np.testing.assert_allclose(LOAD.power(speeds((0, 0, 1)), speeds((0, 0, 2))), 30 + (8 + 30) / 0.7)


def test_discharging_is_the_solution_of_the_differential_equation() -> None:
    battery = Battery(BATTERY, speeds((0.6, 0, 0)))
    for _ in range(1000):
        reading = battery.read(speeds((0.6, 0, 0)), 2.0)
    power = float(LOAD.power(speeds((0.6, 0, 0)), REST)[0])

    def slope(_: float, charge: FloatArray) -> FloatArray:
        source = np.interp(charge, *CURVE.T)
        current = (source - np.sqrt(source**2 - 4 * 0.08 * power)) / (2 * 0.08)
        return -current / 3600 / 10

    truth = solve_ivp(slope, (0, 2000), [0.8], rtol=1e-10, atol=1e-12).y[0, -1]
    assert reading.percentage[0] == pytest.approx(truth, rel=1e-5)
    assert reading.charge[0] == pytest.approx(10 * truth, rel=1e-5)


def test_charge_is_what_the_current_carried() -> None:
    battery = Battery(BATTERY, np.zeros((2, 3)))
    rng = np.random.default_rng(1)
    carried = np.zeros(2)
    for _ in range(200):
        reading = battery.read(rng.uniform(-1, 1, (2, 3)) * [1, 0, 1], 0.1)
        carried += reading.current * 0.1 / 3600
    np.testing.assert_allclose(reading.charge, 8.0 + carried, rtol=1e-12)


def test_braking_charges_but_never_beyond_full() -> None:
    reading = Battery(replace(BATTERY, charge=1.0), speeds((2, 0, 0))).read(speeds((0, 0, 0)), 0.5)
    assert reading.current[0] > 0
    assert reading.voltage[0] > CURVE[-1, 1]
    assert reading.percentage[0] == 1.0


def test_an_empty_battery_and_an_impossible_load_say_so() -> None:
    assert Battery(replace(BATTERY, charge=0.0), REST).read(REST, 1.0).exhausted[0]
    stingy = replace(BATTERY, resistance=10.0)
    reading = Battery(stingy, REST).read(REST, 1.0)
    assert reading.exhausted[0]
    source = np.interp(0.8, *CURVE.T)
    np.testing.assert_allclose(reading.voltage, source / 2)  # at the most power there is
    assert not Battery(BATTERY, REST).read(REST, 1.0).exhausted[0]


def test_without_resistance() -> None:
    reading = Battery(replace(BATTERY, resistance=0.0), REST).read(REST, 1.0)
    np.testing.assert_allclose(reading.current, -30 / np.interp(0.8, *CURVE.T))
