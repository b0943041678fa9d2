# SPDX-License-Identifier: BSD-3-Clause
"""A laboratory on the simulator: it measures with one chair what the critic then holds against another model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.experiment.rehearse import Manner, Rehearsal, manner
from kurumaisu.critic.judge.scan_verdict import criticise_scans as criticise_laser
from kurumaisu.critic.values.criticism import LaserFinding
from kurumaisu.critic.values.recording import LaserMount, Recording, Series
from kurumaisu.experiments import Place, Script, shipped_script
from kurumaisu.experiments.script import Box
from kurumaisu.params import Laser, Model, load_model, shipped
from kurumaisu.sim.settings import load_dynamics
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

DISTANCES = (0.2, 0.5, 1.0, 2.0, 3.9)  # [m] of the wall; the paper says 4, which the gate of 4.0 m would cut off
SCANS = 50  # at each distance
TAPED_SD, SQUARED_SD = 0.001, 0.002  # [m], [rad] ASSUMPTION: how well a bench is taped and squared


def chair() -> Model:
    """Return the package's own chair."""
    return load_model(shipped("launch/md100.yaml"))


def with_laser(model: Model, **changes: object) -> Model:
    """Return the model with other fields of its laser."""
    return replace(model, laser=replace(model.laser, **changes))  # type: ignore[arg-type]


def bench(distances: Sequence[float], yaws: Sequence[float] = (0.0,)) -> Script:
    """Return an experiment: a laser on a bench before a board, at distances [m] and turned by yaws [rad]."""
    places = tuple(
        Place(np.array([WALL - distance, 0.0, yaw]), SCANS * 0.1 + 0.05) for distance in distances for yaw in yaws
    )
    return Script("bench", "the paper's wall", "board.world", Box(2.0, 5.0, 1.0, 1.0), None, (), places)


WALL = 1.30  # [m] of the walls of wall.world and board.world, seen from the start


def on_bench(model: Model) -> Model:
    """Return a model whose laser is all there is: as small as a bench's, and at its origin."""
    small = replace(model.chassis, length=0.06, width=0.06, axle_to_front=0.03)
    return with_laser(replace(model, chassis=small), mount=replace(model.laser.mount, x=0.0))


def measured(model: Model, script: Script | str, nominal: Laser, seed: int, *, taped: bool = True) -> Recording:
    """Return what an experiment on a chair gives, with the map, and the laser where the lab believes it to be."""
    script = shipped_script(script) if isinstance(script, str) else script
    how: Manner = manner()
    if taped:
        how = replace(how, position_sd=TAPED_SD, heading_sd=SQUARED_SD)
    world = shipped(f"worlds/{script.world}")
    dynamics = load_dynamics(shipped("launch/physical.yaml"))
    recording = Rehearsal(model, load_world(world), dynamics, how).run(script, np.random.default_rng(seed))
    place = LaserMount(
        nominal.mount.x, nominal.mount.y, nominal.mount.yaw, nominal.angle_min, nominal.angle_increment, nominal.beams
    )
    return replace(recording, world=world, laser=place)


def middle(recording: Recording, bearing: float) -> Recording:
    """Return a recording with only the beams within a bearing [rad] of straight ahead."""
    laser = recording.laser
    assert laser is not None
    keep = np.flatnonzero(np.abs(laser.angle_min + laser.angle_increment * np.arange(laser.beams)) < bearing)
    fan = replace(laser, angle_min=laser.angle_min + laser.angle_increment * float(keep[0]), beams=len(keep))
    columns = tuple(f"r{i}" for i in range(len(keep)))
    runs = []
    for run in recording.runs:
        assert run.scan is not None
        runs.append(replace(run, scan=Series(run.scan.t, run.scan.values[:, keep], columns)))
    return replace(recording, runs=tuple(runs), laser=fan)


@dataclass(frozen=True)
class Answer:
    """What the critic says of scans: named ids with their probability, and sets that it cannot tell apart."""

    named: dict[str, float]
    confounded: tuple[tuple[str, ...], ...]

    def told(self) -> str:
        """Return it in words."""
        words = [f"{name} (p {p:.2f})" for name, p in self.named.items()]
        words += [" or ".join(group) for group in self.confounded]
        return "; ".join(words) or "none"


def laser_answer(recording: Recording, model: Model, ids: frozenset[str] | None = None) -> Answer:
    """Return what the critic says of scans, held against a model; ids: that may be named, None for all."""
    found: LaserFinding = criticise_laser(recording, model, lambda _: None, ids)
    if found.refused is not None:
        return Answer({}, ((f"refused: {found.refused}",),))
    return Answer({cause.id: cause.p for cause in found.causes}, found.confounded)


def sd_by_bearing(recording: Recording, run: int) -> tuple[FloatArray, FloatArray]:
    """Return the mean [m] and sd [m] of every beam of one of a recording's runs, nan where one is missing."""
    scan = recording.runs[run].scan
    assert scan is not None
    whole = np.isfinite(scan.values).all(axis=0)
    mean, sd = np.full(len(whole), np.nan), np.full(len(whole), np.nan)
    mean[whole], sd[whole] = scan.values[:, whole].mean(axis=0), scan.values[:, whole].std(axis=0, ddof=1)
    return mean, sd
