# SPDX-License-Identifier: BSD-3-Clause
"""One scripted experiment: its file, read strictly."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu import settings
from kurumaisu.errors import Error
from kurumaisu.experiments import timeline
from kurumaisu.experiments.timeline import Phase
from kurumaisu.names import hint
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray

_FOLDER = "launch/experiments"
_KINDS = ("drive", "sweep", "places")


@dataclass(frozen=True)
class Box:
    """Where base_link may be, seen from where it started [m]."""

    ahead: float
    behind: float
    left: float
    right: float

    def excess(self, poses: FloatArray) -> FloatArray:
        """Return how far poses (..., 3) in the frame of the start lie outside, (...) [m]; negative: inside."""
        x, y = poses[..., 0], poses[..., 1]
        return np.asarray(np.max([x - self.ahead, -x - self.behind, y - self.left, -y - self.right], axis=0))


@dataclass(frozen=True)
class Limits:
    """Largest rates that are commanded, all positive: m/s ahead and back, rad/s to either side."""

    v_forward: float
    v_reverse: float
    w: float

    def exceeded(self, v: float, w: float) -> bool:
        """True for rates that go beyond."""
        return v > self.v_forward or -v > self.v_reverse or abs(w) > self.w


@dataclass(frozen=True)
class Place:
    """Where to stand: pose (3,) of base_link in the frame of the start [m, m, rad], for how long [s]."""

    pose: FloatArray
    seconds: float


@dataclass(frozen=True)
class Script:
    """An experiment. It has phases of rates (a drive) or of one steering voltage (a sweep), or places to stand at.

    phases: targets are (v, w) [m/s, rad/s] of a drive, (v_s,) [V] of a sweep; world: of worlds/, where the simulator
    runs it; limits: None unless rates are commanded.
    """

    name: str
    good_for: str
    world: str
    box: Box
    limits: Limits | None
    phases: tuple[Phase, ...]
    places: tuple[Place, ...]

    @property
    def kind(self) -> str:
        """Return drive, sweep or places."""
        if self.places:
            return "places"
        return "drive" if self.limits is not None else "sweep"

    @property
    def seconds(self) -> float:
        """Duration [s], without the ways between places."""
        return sum(phase.seconds for phase in self.phases) + sum(place.seconds for place in self.places)


def names() -> tuple[str, ...]:
    """Return the names of the package's own experiments."""
    return tuple(sorted(path.stem for path in shipped(f"{_FOLDER}/standstill.yaml").parent.glob("*.yaml")))


def shipped_script(name: str) -> Script:
    """Return one of the package's own experiments. Raise Error, with near names, for another one."""
    if name not in names():
        raise Error(f"{name!r} is not an experiment: {hint(name, names(), 'docs/experiments.md')}")
    return load_script(shipped(f"{_FOLDER}/{name}.yaml"))


def load_script(path: Path) -> Script:
    """Read an experiment.

    Raise Error naming file and key for anything missing, unknown or senseless, for rates beyond the file's limits,
    and for a path that leaves the file's box even on a perfect chair.
    """
    top = settings.load(path)
    kind = top.text("kind", _KINDS)
    script = Script(
        name=path.stem,
        good_for=top.text("good_for"),
        world=top.text("world"),
        box=_box(top.section("box")),
        limits=_limits(top.section("limits")) if kind == "drive" else None,
        phases=_phases(top, ("v", "w") if kind == "drive" else ("v_s",)) if kind != "places" else (),
        places=tuple(_place(item) for item in top.items("places")) if kind == "places" else (),
    )
    top.end()
    if not script.phases and not script.places:
        raise top.error("places", "must name at least one place")
    _check(top, script)
    return script


def _box(section: settings.Section) -> Box:
    box = Box(**{name: section.number(name, at_least=0) for name in ("ahead", "behind", "left", "right")})
    section.end()
    return box


def base_limits() -> Limits:
    """Return what base_node lets scripts pass, launch/base_node.yaml: its ramps are too steep to matter."""
    node = settings.load(shipped("launch/base_node.yaml"))
    name = node.section("inputs").section("experiments").text("limits")
    return _rates(node.section("limits").section(name))


def _limits(section: settings.Section) -> Limits:
    limits = _rates(section)
    section.end()
    return limits


def _rates(section: settings.Section) -> Limits:
    return Limits(**{name: section.number(name, above=0) for name in ("v_forward", "v_reverse", "w")})


def _phases(top: settings.Section, rates: tuple[str, ...]) -> tuple[Phase, ...]:
    repeat = top.integer("repeat", at_least=1)
    phases = tuple(_phase(item, rates) for item in top.items("phases"))
    if not phases:
        raise top.error("phases", "must name at least one phase")
    if any(phases[-1].target):
        raise top.error("phases", "must end at rest")
    return phases * repeat


def _phase(item: settings.Section, rates: tuple[str, ...]) -> Phase:
    phase = Phase(
        seconds=item.number("seconds", above=0),
        target=tuple(item.number(rate) for rate in rates),
        ramp=item.number("ramp", at_least=0),
    )
    item.end()
    if phase.ramp > phase.seconds:
        raise item.error("ramp", f"takes longer than the phase: {phase.ramp:g} of {phase.seconds:g} s")
    return phase


def _place(item: settings.Section) -> Place:
    place = Place(np.array([item.number(name) for name in ("x", "y", "yaw")]), item.number("seconds", above=0))
    item.end()
    return place


def _check(top: settings.Section, script: Script) -> None:
    """Raise Error for what goes beyond the limits or leaves the box."""
    for phase in script.phases if script.limits is not None else ():
        if script.limits is not None and script.limits.exceeded(phase.target[0], phase.target[1]):
            raise top.error("limits", f"are exceeded by the phase v {phase.target[0]:g}, w {phase.target[1]:g}")
    poses = np.array([place.pose for place in script.places])
    if script.limits is not None:
        poses = timeline.nominal_path(script.phases)
    if len(poses) and script.box.excess(poses).max() > 0:
        worst = poses[np.argmax(script.box.excess(poses))]
        raise top.error("box", f"is left at x {worst[0]:.2f}, y {worst[1]:.2f} m")
