# SPDX-License-Identifier: BSD-3-Clause
"""What dynamic_reconfigure is told of the catalogue, and what becomes of a request; without a master."""

import math

import pytest
import yaml

from kurumaisu import effects
from kurumaisu.params import EffectSetting
from kurumaisu.ros.sim import effects_config as config
from kurumaisu.viewer.effects import listed

LAG = EffectSetting("base.lag_w", {"tau": 0.4})
LIGHT = EffectSetting("laser.crosstalk", {"probability": 0.1, "width": 0.2, "drift": -0.3, "reach": 5.0})


def leaves(group):
    return [*group["parameters"], *(leaf for below in group["groups"] for leaf in leaves(below))]


def test_every_effect_has_a_group_of_its_own_below_its_family():
    root = config.description(()).config_description
    families = {group["name"]: group for group in root["groups"]}
    assert {name: len(group["groups"]) for name, group in families.items()} == {
        "base": len(effects.BASE),
        "laser": len(effects.LASER),
        "world": len(effects.WORLD),
    }
    every = [root, *families.values(), *(group for family in families.values() for group in family["groups"])]
    assert len({group["id"] for group in every}) == len(every)
    assert all(group["parent"] == family["id"] for family in families.values() for group in family["groups"])
    names = [leaf["name"] for leaf in leaves(root)]
    assert len(set(names)) == len(names) == len(effects.ALL) + sum(len(effect.parameters) for effect in effects.ALL)
    assert all(name.isidentifier() for name in names)


@pytest.mark.parametrize("acting", [(), (LAG,), (LAG, LIGHT), (LIGHT, LAG)])
def test_what_acts_is_what_is_enabled(acting):
    defaults = config.description(acting).defaults
    assert {one.id for one in config.settings_of(defaults)} == {one.id for one in acting}
    assert {one.id: one.parameters for one in config.settings_of(defaults)} == {
        one.id: one.parameters for one in acting
    }


def test_defaults_lie_within_their_bounds():
    kind = config.description(())
    for name, value in kind.defaults.items():
        assert kind.min[name] <= value <= kind.max[name]
        assert type(value) is (bool if kind.type[name] == "bool" else float), "or the encoding forgets it"


@pytest.mark.parametrize(
    ("request_", "changes", "complaint"),
    [
        ({"base_lag_w_tau": 0.3}, {"base_lag_w_tau": 0.3}, None),
        ({"base_lag_w_tau": 3}, {"base_lag_w_tau": 3.0}, None),
        ({"base_lag_w_tau": -1.0}, {"base_lag_w_tau": 0.0}, "tau must be 0 to 3 s: -1; 0 is used"),
        ({"base_lag_w_tau": math.inf}, {"base_lag_w_tau": 3.0}, "tau must be 0 to 3 s: inf; 3 is used"),
        ({"base_lag_w_tau": math.nan}, {}, "nan; it stays as it is"),
        ({"base_lag_w_enabled": 1}, {"base_lag_w_enabled": True}, None),
        ({"tau": 0.3}, {}, "tau: is not a parameter of an effect"),
    ],
)
def test_a_request_is_sifted(request_, changes, complaint):
    asked = config.sift(request_)
    assert asked.changes == changes
    assert [type(value) for value in asked.changes.values()] == [type(value) for value in changes.values()]
    assert len(asked.complaints) == (complaint is not None)
    assert complaint is None or asked.complaints[0].endswith(complaint)


@pytest.mark.parametrize("settings", [(), (LAG,), (LAG, LIGHT)])
def test_the_list_is_a_file_of_effects(settings):
    read = yaml.safe_load(listed(settings))
    assert read == {"effects": [{"id": one.id, "parameters": one.parameters} for one in settings]}
