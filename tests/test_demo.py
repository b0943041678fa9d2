# SPDX-License-Identifier: BSD-3-Clause
"""The demonstration's own parts: what it hides, how it records, how it says that a drive failed."""

import numpy as np
import pytest

from kurumaisu import effects
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.demo import __main__, hidden, processes
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting


def test_what_is_hidden_is_in_the_catalogue_and_varies():
    drawn = [hidden.draw(np.random.default_rng(seed)) for seed in range(60)]
    assert {secret.id for secret in drawn} == set(hidden.SHOWN)
    for secret in drawn:
        effect = effects.by_id(secret.id)
        form = {name: secret.parameters[name] for name in (effect.forms[0] if effect.forms else ())}
        assert form in effect.forms or not effect.forms
        for parameter in effect.parameters:
            value = secret.parameters[parameter.name]
            assert parameter.lower <= value <= parameter.upper
            assert parameter.name in form or abs(value - parameter.null) >= parameter.scale


def test_a_recorded_drive_shows_the_secret(tmp_path):
    """A gain of 2 in the plant: the way driven is twice the way commanded, by the recording's own numbers."""
    hidden.record(tmp_path, EffectSetting("base.gain_v", {"gain": 1.0}), np.random.default_rng(3))
    recording = read_recording(tmp_path)
    assert recording.truth == (0.005, 0.005)
    assert len(recording.runs) == 3
    run = recording.runs[0]
    held = np.diff([*run.command.t, run.pose.t[-1]])
    asked = np.sum(np.abs(run.command.column("v")) * held)
    way = np.hypot(*np.diff(run.pose.values[::5, :2], axis=0).T).sum()
    assert way == pytest.approx(2 * asked, rel=0.1)


def test_a_failed_launch_is_told_with_the_end_of_its_log(tmp_path):
    with pytest.raises(Error, match=r"roslaunch kurumaisu nowhere.launch ended with code(.|\n)*nowhere.launch"):
        processes.roslaunch(["kurumaisu", "nowhere.launch"], tmp_path / "log", 60.0, "failing")


def test_the_demonstration_names_a_folder_that_it_cannot_write(tmp_path, monkeypatch, capsys):
    (tmp_path / "file").touch()
    monkeypatch.setattr("sys.argv", ["demo", "-o", str(tmp_path / "file" / "out")])
    assert __main__.main() == 1
    assert f"{tmp_path}/file/out: Not a directory" in capsys.readouterr().err
