# SPDX-License-Identifier: BSD-3-Clause
"""Figure 9: near walls are read more noisily; either the range does it, or that a near wall is met obliquely.

The law of range is equation (4) as printed. The law of incidence has a noise that is least ahead and grows with the
footprint of the beam, tuned here so that the paper's five numbers come out nearly alike.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu._core import LaserError
from kurumaisu.experiments import Script
from kurumaisu.params import EffectSetting, Model
from kurumaisu.riddles import lab

# Noise by the law of incidence: [m], [1], [1/m] at normal incidence; and its growth per unit of (1 / cos a - 1).
_NORMAL = (0.0020, -0.0002, 0.00015)
_GROWTH = 0.25
_BEAMS = 41  # that the board takes from 3.9 m: the fewest
_ASKED = frozenset({"laser.incidence_noise", "laser.range_noise"})


@dataclass(frozen=True)
class _Law:
    name: str
    chair: Model


def tell(seed: int) -> Iterator[str]:
    """Yield the riddle, line by line."""
    yield "figure 9: the standard deviation rises towards near walls. Range, or incidence?"
    printed = lab.on_bench(lab.chair())
    smooth = _with_sigma(printed, _NORMAL)
    oblique = replace(smooth, effects=(EffectSetting("laser.incidence_noise", {"gain": _GROWTH}),))
    laws = (_Law("range: equation (4)", printed), _Law("incidence", oblique))
    square = lab.bench(lab.DISTANCES)
    yield ""
    yield f"{lab.SCANS} scans of a wall, square on; standard deviation over all beams on a board 1 m wide [mm]:"
    yield "truth                " + "".join(f"{distance:8.1f} m" for distance in lab.DISTANCES)
    for law in laws:
        sds = _pooled(law.chair, square, seed)
        yield f"{law.name:21s}" + "".join(f"{1e3 * sd:10.2f}" for sd in sds)
    sampled = 1e3 * 0.0035 / np.sqrt(2 * (lab.SCANS - 1) * _BEAMS)
    yield f"sampling error: at most about {sampled:.2f} mm"

    wide = lab.chair(), replace(lab.chair(), laser=oblique.laser, effects=oblique.effects)
    wide = wide[0], lab.with_laser(wide[1], mount=wide[0].laser.mount)
    for name, script, chairs in (
        ("the board, square on", square, [law.chair for law in laws]),
        ("a wall 8 m wide, from one distance: wall_yawed", "wall_yawed", wide),
        ("a wall 8 m wide, from five distances: wall_five_distances", "wall_five_distances", wide),
    ):
        yield ""
        yield f"the critic, asked between range and incidence, by every beam; {name}:"
        nominal = printed if script is square else lab.chair()
        for law, chair in zip(laws, chairs, strict=True):
            found = lab.laser_answer(lab.measured(chair, script, nominal.laser, seed), nominal, _ASKED)
            yield f"  truth {law.name:21s} {found.told()}"


def _with_sigma(model: Model, sigma: tuple[float, float, float]) -> Model:
    """Return a model with another law of the noise; the rest of equation (4) as it is."""
    return lab.with_laser(model, error=_error(sigma))


def _error(sigma: tuple[float, float, float]) -> LaserError:
    return LaserError(
        scale=1.004587, datum_offset=0.058826, sigma=sigma, resolution=0.001, range_min=0.06, range_max=4.0
    )


def _pooled(chair: Model, script: Script, seed: int) -> list[float]:
    """Return the sd [m] of all beams of the wall together, per distance."""
    recording = lab.measured(chair, script, chair.laser, seed)
    sds = [lab.sd_by_bearing(recording, run)[1] for run in range(len(recording.runs))]
    return [float(np.sqrt(np.nanmean(sd**2))) for sd in sds]
