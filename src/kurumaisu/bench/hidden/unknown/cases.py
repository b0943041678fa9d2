# SPDX-License-Identifier: BSD-3-Clause
"""Cases of what is in no catalogue, sized by what the whole catalogue together leaves of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from kurumaisu.bench.hidden.base import recordings, sizing
from kurumaisu.bench.hidden.generator.case import Ask, Case, Truth
from kurumaisu.bench.hidden.generator.motion import Sizes
from kurumaisu.bench.hidden.generator.noise import REGIMES, USUAL, draw_lasting, draw_regime
from kurumaisu.bench.hidden.generator.rooms import world_text
from kurumaisu.bench.hidden.generator.tours import draw_tour
from kurumaisu.bench.hidden.laser import cases
from kurumaisu.bench.hidden.laser.catalogue import LASER
from kurumaisu.bench.hidden.laser.signal import MEANS, LaserScale
from kurumaisu.bench.hidden.laser.usual_effects import BACKDROPS, draw_backdrop
from kurumaisu.bench.hidden.unknown.forms import UNKNOWN_BASE, UNKNOWN_LASER, Unknown
from kurumaisu.whole_files import write_whole


def make_unknown_base(ask: Ask, seed: int) -> Case:
    """Return a case of the base with something unknown; z is what all ids of the contract together leave."""
    what, where, how = (np.random.default_rng([seed, 20 + i]) for i in range(3))
    name = ask.ids[0] if ask.ids else str(what.choice(list(UNKNOWN_BASE)))
    unknown = UNKNOWN_BASE[name]
    regime = REGIMES[ask.regime] if ask.regime else draw_lasting(draw_regime(how), how)
    drives = recordings.draw_drives(ask.design, regime, where)
    scale = recordings.Scale(drives)
    columns = sizing.rival_columns(scale, sizing.RIVALS)
    everything = {"": np.column_stack(list(columns.values()))}
    sizes = unknown.draw(what)

    def outside(size: float) -> float:
        signal = scale.signals([[unknown.fault({**sizes, "size": size}, "plain")]])[:, 0]
        return sizing.left_after_rivals(signal, everything)[""]

    sizes["size"] = sizing.scaled_to(wanted_z(ask, what), outside, sizes["size"], 4 * unknown.typical)
    fault = unknown.fault(sizes, "plain")
    left = sizing.left_after_rivals(scale.signals([[fault]])[:, 0], columns)
    null = recordings.recording(f"hidden {seed}", drives, ())
    found = recordings.recording(f"hidden {seed}", drives, [fault])
    return Case(found, null, _truth(name, unknown, sizes, outside(sizes["size"]), left), seed)


def make_unknown_laser(ask: Ask, seed: int, folder: Path) -> Case:
    """Return a case of the laser with something unknown; z is what all ids of the contract together leave."""
    what, where, how = (np.random.default_rng([seed, 30 + i]) for i in range(3))
    name = ask.ids[0] if ask.ids else str(what.choice(list(UNKNOWN_LASER)))
    unknown = UNKNOWN_LASER[name]
    backdrop = BACKDROPS[ask.regime] if ask.regime in BACKDROPS else draw_backdrop(how)
    tour = draw_tour(ask.design or "room", replace(USUAL, position_sd=0.003, heading_sd=0.003), where)
    scale = LaserScale(tour, backdrop)
    sizes = unknown.draw(what)
    own = scale.signal(unknown.fault(sizes, "plain"))[..., None]
    rivals = scale.rivals([name for name in MEANS if not LASER[name].moving])
    gram, rest = cases.left_after_rivals(scale, own, 1, rivals)
    outside = cases.left(gram, 1, range(1, len(gram)))
    factor = max(wanted_z(ask, what) / outside, cases.MATERIAL / cases.rms(own))
    sizes["size"] *= factor
    rest = {rival: factor * least for rival, least in rest.items()}
    folder.mkdir(parents=True, exist_ok=True)
    draw = cases.Draw(int(how.integers(2**31)), backdrop, folder / f"hidden_{seed}.world")
    write_whole({draw.world: world_text(f"hidden {seed}", tour.room)})
    fault = unknown.fault(sizes, "plain")
    null = cases.recording(f"hidden {seed}", tour, (), draw)
    found = cases.recording(f"hidden {seed}", tour, [fault], draw)
    truth = _truth(name, unknown, sizes, factor * outside, rest)
    return Case(found, null, replace(truth, background=backdrop.ids), seed)


def wanted_z(ask: Ask, rng: np.random.Generator) -> float:
    """Return the z that is asked for, or one log-uniform in 5 to 60."""
    return ask.z or float(np.exp(rng.uniform(np.log(5.0), np.log(60.0))))


def _truth(name: str, unknown: Unknown, sizes: Sizes, outside: float, left: dict[str, float]) -> Truth:
    nearest = min(left, key=lambda rival: left[rival])
    return Truth(
        "unknown",
        (),
        {name: dict(sizes)},
        z=outside,
        z_rival=left[nearest],
        rival=nearest,
        channel=unknown.channel,
        covariates=unknown.covariates,
    )
