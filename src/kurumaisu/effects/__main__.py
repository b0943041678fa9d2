# SPDX-License-Identifier: BSD-3-Clause
"""Print the catalogue of effects as docs/effects.md has it: python3 -m kurumaisu.effects."""

from collections.abc import Sequence

from kurumaisu import effects
from kurumaisu.effects.mechanism import Mechanism, Parameter

_HEAD = """\
# The effects that the simulator can have

Written by `scripts/run python3 -m kurumaisu.effects > docs/effects.md`; a test compares the two.

An effect is one way in which a real chair, laser or world departs from equations (1)-(4). It is switched on in the
list `effects` of a model file, or in a separate file, whose effects are added to those of the model:

```yaml
effects:
  - {id: base.lag_w, parameters: {tau: 0.2}}
  - {id: laser.latency, parameters: {delay: 0.02}}
```

`sim.launch effects:=FILE` takes such a file; [real_laser.yaml](../launch/real_laser.yaml) is one. In a running
simulator each can be switched on, changed and off again: [sim_node.md](sim_node.md#effects-while-it-runs).

Every parameter must be given. The order of the list does not matter: effects act by stage, those of a stage in the
order of the tables. Each effect on the laser draws from a generator of its own, so that the laser's noise is the same
with it and without. An effect of size 0 does nothing; parameters without such a zero have a middle instead, as `tau`
900 ± 600 s. Sizes are expected ones, where a fit starts, and measured only where a source says so; bounds are
those that the file may hold.

Symbols: v, u, w forward, leftward speed [m/s] and yaw rate [rad/s]; V_f, V_s voltages [V]; t time [s] since the reset,
or since the effect was switched on later; r true range [m], φ bearing, a angle of incidence (0: along the wall's
normal) [rad]; µ, σ mean and standard deviation of a reading [m]; n, z standard normal. Rates are means over the
simulator's steps.
"""
_BASE = """
## The base

Voltages pass the stages CONVERTER and CONTROLLER; the resulting rates pass TRANSPORT, THRESHOLD, GAIN,
RESPONSE and FLOOR; effects of the stage REFERENCE change `ground_truth`, not the motion. The critic looks
for all of them.
"""
_LASER = """
## The laser

GEOMETRY changes where a beam leaves from, and when; then the ray is cast. BIAS changes the mean and SPREAD the
standard deviation that equation (4) gives, NOISE the noise; the reading is made of the three. OUTLIER and GRID change
readings. The laser's own resolution and range limits come last: NaN is an invalid reading, +inf no return. An effect on
stamps makes them differ from the true times of the beams; the chair is where it is at the true times.
"""
_WORLD = """
## The world

The walls are moved when the simulator is reset, both for the laser and for contacts; the world file is the map.
"""
_SMOOTH = """
## What is not in the catalogue

For an error that none of these explains, the critic extends the model by a curve, which the simulator runs as it
runs all others: `smooth.CHANNEL.COVARIATE` adds a rate that follows another quantity, while the chair moves, after
everything else of the stage FLOOR; the channels `v_gain` and `w_gain` multiply the rate by 1 + curve, `curvature`
adds a yaw rate of curve · v, and `speed` a forward speed of curve · sign(v).

```yaml
effects:
  - {id: smooth.w.x, parameters: {knot_0: -1.0, knot_1: 0.0, knot_2: 2.0, value_0: 0.0, value_1: 0.02, value_2: 0.02}}
  - {id: smooth.v.heading, parameters: {period: 6.283185, level: 0.0, cos_1: 0.01, sin_1: 0.0}}
```

Between knots, which must increase, the curve is straight; beyond the outer ones it is constant. There may be 1 to 64 of
them, counted from 0. Over a periodic covariate, and over time, x and y where a `period` is given, the curve is
level + Σ cos_k · cos(2πk · c / period) + sin_k · sin(...), counted from 1. A covariate in the table also needs the
parameter in its row. Any other name is that of a quantity measured in a recording (a column of `covariate.csv`); the
simulator does not know it and holds it at the parameter `now`, which the critic sets to its mean.

`smooth.range.COVARIATE` adds such a curve, in metres, to the laser's readings, with the stage BIAS; all of them have
knots. They follow `range` [m], `incidence`, `bearing`, `heading`, `world_bearing` [rad, within half a turn], `time` [s]
since the laser was switched on, or `hit_x`, `hit_y` [m] in the map; besides, what is known beside the scans: the
chair's rates `v`, `w`, and columns of `covariate.csv`, which the simulator does not know. `smooth.scatter.COVARIATE`
multiplies the noise by exp(curve), with the stage SPREAD.

`smooth.reference_x.COVARIATE`, `reference_y` [m] and `reference_heading` [rad] add a curve to the pose in the map that
a reference measures, with the stage REFERENCE, and leave its rates. They follow `x`, `y`, `heading`, `v` or `w`.

```yaml
effects:
  - {id: smooth.range.range, parameters: {knot_0: 1.9, knot_1: 2.1, value_0: 0.0, value_1: 0.01}}
```
"""


def main() -> None:
    """Print it."""
    print(text(), end="")


def text() -> str:
    """Return the catalogue in Markdown."""
    parts = [_HEAD]
    for head, family in ((_BASE, effects.BASE), (_LASER, effects.LASER), (_WORLD, effects.WORLD)):
        parts.append(head)
        parts.append(_table(family))
    return "\n".join([*parts, _SMOOTH, _smooth_table()])


def _smooth_table() -> str:
    """Return channels and covariates of smooth effects."""
    rows = [f"Channels: {', '.join(f'`{name}` [{channel.unit}]' for name, channel in effects.CHANNELS.items())}.", ""]
    rows += ["| covariate | what it is | further parameter |", "|---|---|---|"]
    for name, meaning in effects.MEANINGS.items():
        constant = effects.CONSTANTS.get(name)
        rows.append(f"| `{name}` | {meaning} | {f'`{constant[0]}` [{constant[1]}]' if constant else ''} |")
    return "\n".join(rows) + "\n"


def _table(family: Sequence[type[Mechanism]]) -> str:
    ordered = sorted(family, key=lambda effect: getattr(effect, "stage", 0))
    rows = [
        "| id | stage | what is seen | form | parameters: typical size, bounds | known from; size expected |",
        "|---|---|---|---|---|---|",
    ]
    for effect in ordered:
        stage = effect.stage.name if hasattr(effect, "stage") else "-"
        sizes = "; ".join(_size(parameter) for parameter in effect.parameters)
        cells = (f"`{effect.id}`", stage, effect.sentence, effect.formula, sizes, effect.source)
        rows.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    return "\n".join(rows) + "\n"


def _size(parameter: Parameter) -> str:
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    about = f"{parameter.null:g} ± " if parameter.null else ""
    return f"`{parameter.name}` {about}{parameter.scale:g}{unit}, {parameter.lower:g} to {parameter.upper:g}"


if __name__ == "__main__":
    main()
