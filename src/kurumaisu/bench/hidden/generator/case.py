# SPDX-License-Identifier: BSD-3-Clause
"""A recording with something hidden in it, the truth about it, and its twin without."""

from __future__ import annotations

from dataclasses import dataclass, field

from kurumaisu.bench.hidden.generator.noise import Regime
from kurumaisu.critic.values.recording import Recording
from kurumaisu.types import FloatArray

STRONG, APART = 10.0, 6.0  # z from which an id must be found, and be told from its nearest rival
FAINTEST = 5.0  # z that is hidden at least; beside other causes less of it may show
KINDS = ("null", "single", "pair", "triple", "unknown", "wrong", "confounded")


@dataclass(frozen=True)
class Truth:
    """What was hidden.

    kind: of KINDS; ids: of the contract, in order; parameters: by id, what the usual equation calls the sizes (an
    equivalent where form is 'other'); z: whitened norm of the whole signal, of an unknown one what the whole catalogue
    leaves of it; z_alone: of each id's share in it; z_rival: what remains of the signal beside the nearest rival, whose
    id is rival; z_form: what the usual equation leaves of it; channel, covariates: where something outside the
    catalogue shows, and what it is right to say that it follows; problem: what is wrong with wrong data; accepted: sets
    of ids of which each explains the signal to within z 3; near: ids that leave less than APART of it, which a set may
    have or not; background: ids that the null has, too, which are right to name and right to leave out.
    """

    kind: str
    ids: tuple[str, ...] = ()
    parameters: dict[str, dict[str, float]] = field(default_factory=dict)
    z: float = 0.0
    z_alone: dict[str, float] = field(default_factory=dict)
    z_rival: float = float("inf")
    rival: str = ""
    z_form: float = 0.0
    channel: str = ""
    covariates: tuple[str, ...] = ()
    problem: str = ""
    accepted: tuple[tuple[str, ...], ...] = ()
    near: tuple[str, ...] = ()
    background: tuple[str, ...] = ()

    @property
    def shown(self) -> bool:
        """Tell whether of each of the ids as much shows beside the others as of the faintest that is hidden alone."""
        return min([self.z, *self.z_alone.values()]) >= FAINTEST

    @property
    def strong(self) -> bool:
        """Tell whether each of the ids shows beside the others, and none is nearly another one."""
        return min([self.z, *self.z_alone.values()]) >= STRONG and self.z_rival >= APART


@dataclass(frozen=True)
class Known:
    """What an oracle knows: poses (m, 3) to be expected at each run's stamps, without any noise; and the noise."""

    poses: tuple[FloatArray, ...]
    regime: Regime


@dataclass(frozen=True)
class Case:
    """recording: what the critic is given; null: the same drives and noise with nothing hidden; seed: of both.

    known: to an oracle, where what is hidden changes the mean motion.
    """

    recording: Recording
    null: Recording
    truth: Truth
    seed: int
    known: Known | None = None


@dataclass(frozen=True)
class Ask:
    """What to hide.

    kind: of KINDS; ids: of the contract, or the name of something unknown or wrong, empty for a random choice;
    z: whitened norm, None for one log-uniform in 5 to 60; form: 'plain' equations or 'other' ones;
    regime: name in noise.REGIMES, or for lasers in backdrop.BACKDROPS, None for a random one;
    design: name in drives.DESIGNS, or for lasers 'room', 'wall' or 'drive', None for a rich one;
    family: 'base' or 'laser', which are ids drawn at random from.
    """

    kind: str
    ids: tuple[str, ...] = ()
    z: float | None = None
    form: str = "other"
    regime: str | None = None
    design: str | None = None
    family: str = "base"
