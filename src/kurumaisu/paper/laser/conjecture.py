# SPDX-License-Identifier: BSD-3-Clause
"""The paper's conjecture, asked so that a board can answer it.

Do oblique beams follow the law of the square ones?

Held against equation (4) as printed, whose own rise towards near walls may be what incidence did to its data, a board
says that the range's law is wrong, and that is all it says: what is noisier obliquely is then steadier ahead. So the
law is found first from the beams straight ahead, which incidence does not touch, and all beams are held against that.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from kurumaisu._core import LaserError
from kurumaisu.critic.values.recording import Recording
from kurumaisu.paper.laser import law as laser_law
from kurumaisu.paper.laser.law import LaserLaw
from kurumaisu.paper.laser.wall import ahead_of, places_of
from kurumaisu.paper.options import PaperOptions
from kurumaisu.params import EffectSetting, Model
from kurumaisu.riddles import lab

ASKED = frozenset({"laser.incidence_noise", "laser.range_noise"})
# A laser whose noise does not rise towards near walls, but with incidence: [m], [1], [1/m], and the growth.
_NORMAL, _GROWTH = (0.0020, -0.0002, 0.00015), 0.25


def answer(
    recording: Recording, distances: Sequence[float], model: Model, resolution: float, options: PaperOptions
) -> lab.Answer:
    """Return which of range and incidence the critic names, of scans with the map of their wall.

    distances [m]: of the runs, in the order of their names. Raise Error for what is wrong with the wall.
    """
    places = places_of(recording, distances, model.laser, options.wall)
    few = replace(options.bootstrap, resamples=2)  # its intervals are not looked at
    law = laser_law.fit([ahead_of(place, options.wall) for place in places], resolution, 0.0, few)
    return lab.laser_answer(recording, lab.with_laser(model, error=_error(law, model, resolution)), ASKED)


def _error(law: LaserLaw, model: Model, resolution: float) -> LaserError:
    constant, linear, square = (c.value for c in law.sigma)
    return LaserError(
        scale=law.scale.value,
        datum_offset=law.datum_offset.value,
        sigma=(constant, linear, square),
        resolution=resolution,
        range_min=model.laser.range_min,
        range_max=model.laser.range_max,
    )


def tell(seed: int, resolution: float, options: PaperOptions) -> Iterator[str]:
    """Yield what the board says of data made either way, line by line."""
    yield ""
    yield "the board again, all its beams held against the law that its beams straight ahead have:"
    for name, chair in chairs(resolution).items():
        measured = lab.measured(chair, lab.bench(lab.DISTANCES), chair.laser, seed)
        found = answer(measured, lab.DISTANCES, lab.on_bench(lab.chair()), resolution, options)
        yield f"  truth {name:21s} {found.told()}"


def chairs(resolution: float) -> dict[str, Model]:
    """Return lasers on a bench whose noise is by range, equation (4), and by incidence."""
    printed = lab.on_bench(lab.chair())
    error = LaserError(
        scale=1.004587,
        datum_offset=0.058826,
        sigma=_NORMAL,
        resolution=resolution,
        range_min=printed.laser.range_min,
        range_max=printed.laser.range_max,
    )
    oblique = replace(
        lab.with_laser(printed, error=error), effects=(EffectSetting("laser.incidence_noise", {"gain": _GROWTH}),)
    )
    return {"range: equation (4)": printed, "incidence": oblique}
