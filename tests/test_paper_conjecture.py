# SPDX-License-Identifier: BSD-3-Clause
"""Range or incidence: a square board tells when its beams straight ahead say first what the law is."""

import pytest

from kurumaisu.critic.experiment.rehearse import write
from kurumaisu.critic.values.recording import Recording
from kurumaisu.errors import Error
from kurumaisu.paper.laser import conjecture
from kurumaisu.paper.options import load_options
from kurumaisu.params import shipped
from kurumaisu.riddles import lab
from kurumaisu.ros.paper.command import main

STEP = 0.001
OPTIONS = load_options()
MODEL = lab.on_bench(lab.chair())
MADE = conjecture.chairs(STEP)


def board(name, seed=7):
    chair = MADE[name]
    return lab.measured(chair, lab.bench(lab.DISTANCES), chair.laser, seed)


@pytest.mark.parametrize(("truth", "named"), [("range: equation (4)", []), ("incidence", ["laser.incidence_noise"])])
def test_the_board_names_what_made_its_data(truth, named):
    found = conjecture.answer(board(truth), lab.DISTANCES, MODEL, STEP, OPTIONS)
    assert list(found.named) == named
    assert found.confounded == ()
    assert all(p > 0.99 for p in found.named.values())


def test_a_recording_is_asked_by_the_command(tmp_path, capsys):
    recording = board("incidence")
    bench = tmp_path / "bench.yaml"
    from kurumaisu.paper.laser import wall_experiment

    wall_experiment.write_model(shipped("launch/md100.yaml"), OPTIONS.wall, bench)
    write(tmp_path / "board", recording)
    meta = tmp_path / "board/meta.yaml"
    meta.write_text(meta.read_text() + "world: board.world\n")
    for path in ("board.world", "md100.inc"):
        (tmp_path / "board" / path).write_text(shipped(f"worlds/{path}").read_text())
    arguments = ["conjecture", str(tmp_path / "board"), "--model", str(bench), "--out", str(tmp_path / "out")]
    assert main([*arguments, "--distances", *map(str, lab.DISTANCES)]) == 0
    told = (tmp_path / "out/conjecture.txt").read_text()
    assert "held against the law of the beams straight ahead: laser.incidence_noise (p " in told
    assert main([*arguments, "--distances", "1", "2"]) == 1
    assert "2 distances, 5 runs with scans" in capsys.readouterr().err


def test_too_few_distances_have_no_law_of_their_own():
    recording = board("incidence")
    three = Recording("three", recording.runs[:3], train=(), laser=recording.laser, world=recording.world)
    with pytest.raises(Error, match="3 distances, 4 are needed"):
        conjecture.answer(three, lab.DISTANCES[:3], MODEL, STEP, OPTIONS)
