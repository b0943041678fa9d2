# SPDX-License-Identifier: BSD-3-Clause
"""From readings to normal equations: residuals and columns, whitened, the errors that scans share integrated out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kurumaisu.critic.ranges.noise.reading_noise import OUTLIER, BeamNoise, estimate_reading_noise, expected_readings
from kurumaisu.critic.ranges.noise.scan_noise import NoiseLikelihood, estimate, with_lasting_common_mode
from kurumaisu.critic.ranges.noise.shared_errors import (
    Gram,
    Grams,
    Layout,
    OffsetProducts,
    ScanNoise,
    Stacked,
    lasting_sds,
    offset_products,
    own_pose_sds,
    pose_sds,
    whitened,
    without_beam_offsets,
)
from kurumaisu.critic.ranges.poses.pose_corrections import (
    MotionEvidence,
    PoseEvidence,
    motion_evidence,
    pose_corrected,
    pose_evidence,
    stands_of,
)
from kurumaisu.critic.ranges.scans.beams import Shots, deviations, model_effects_with, moved_by_pose, some_scans
from kurumaisu.critic.ranges.scans.map_changes import Sights, blocked_beams, described, map_change, passing_objects
from kurumaisu.critic.ranges.scans.valid_readings import (
    cut_off_ends,
    grid_step,
    inside_ends,
    pose_weights,
    unrounded,
    usable_beams,
    usable_readings,
    without_cut_off,
)
from kurumaisu.critic.ranges.signals.coefficient_blocks import blocks
from kurumaisu.critic.ranges.signals.effect_columns import EffectColumns, Form
from kurumaisu.critic.ranges.signals.form_error import FormFamily
from kurumaisu.critic.values.verdict import Unknown
from kurumaisu.params import EffectSetting
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray, IntArray

_SURE = 0.3  # share of the scans that must lie on a smooth path, or else none is preferred
_ROUNDS = 3
_SHIFTS = 2  # times that poses are sought by the scans
_KEPT = 0.1  # share of a reading's variance that a fit leaves, below which what is left says nothing of it
_BROAD = ScanNoise(position_sd=0.02, heading_sd=0.01, common_sd=0.01, common_tau=1.0)  # before any is known


@dataclass(frozen=True)
class NormalEquations:
    """gram (p + 1, p + 1): normal equations of all columns and, last, the residual; noise that made them so.

    scan_noise: the likeliest; wary: with which the equations are made; nobody knows how long its common mode lasts.
    """

    gram: FloatArray
    scan_noise: ScanNoise
    wary: ScanNoise
    beam_noise: BeamNoise
    readings: int


class Assembly:
    """Residuals, columns and what scans share, of some shots."""

    def __init__(self, shots: Shots, ids: frozenset[str] | None = None) -> None:
        """Take the shots, and the effects to look for; None for all."""
        self.hats = [pose_weights(shots, row) for row in range(len(shots.stamps))]
        self.layout = Layout(shots.stamps, shots.run, stands_of(shots))
        self.tracks = shots.tracks
        self.kinked = [np.zeros(len(track.times), dtype=bool) for track in shots.tracks]
        self.columns = np.empty((*shots.measured.shape, 0), dtype=np.float32)
        self._linearise(shots, roughly=True)
        self.motion: list[MotionEvidence] | None = None
        self.blocked = blocked_beams(shots.measured, self.marks.base)
        ends = cut_off_ends(shots.measured, self.marks.base)
        somewhere = without_cut_off(shots.measured, ends)
        # Where readings of the map's own walls are cut off, only what stands before them is left.
        kept = np.where(inside_ends(self.marks.base, ends), self.marks.base, np.nan)
        self.map_change = map_change(somewhere, kept, self.marks.seen.ends(self.marks.base), self.marks.seen.incidence)
        # Which readings (k, b) are of what the map has, as far as is known.
        self.mapped = ~self.blocked & ~self.map_change.readings
        others = np.where(self.mapped, somewhere, np.nan)
        self.passing_objects = passing_objects(self._seen_by(others))
        self.mapped &= ~self.passing_objects.readings
        self.first = self._trust()
        for i in range(_SHIFTS):
            found, self.kinked = pose_corrected(self.shots, self.tracks, self.hats, self.layout, self._sights())
            self._linearise(found, roughly=i < _SHIFTS - 1)
        self.passing_objects = self.passing_objects.with_close(self._seen_by(others))
        self.mapped &= ~self.passing_objects.readings
        self.motion = self._motion()
        self.first = replace(self._trust(), valid=self.first.valid & self._trust().valid)
        self.geometry = usable_beams(self.shots, self.marks.seen, self.marks.base) & self.mapped
        self.forms, fixed = self.marks.forms(ids)
        self.free, more = blocks(self.shots, self.marks, self.poses, fixed.shape[2], ids)
        self.columns = np.concatenate([fixed, more], axis=2)
        # A beam that meets nothing with one of the effects at work says nothing about it.
        self.first = replace(self.first, valid=self.first.valid & np.isfinite(self.columns).all(axis=2))
        self._fixed = fixed.shape[2]
        self._nuisance = slice(0, 0)

    def _linearise(self, shots: Shots, *, roughly: bool) -> None:
        """Predict at the shots' shifted poses; the residual is as of the reference's own.

        roughly: where poses are only sought, one side of a difference will do.
        """
        self.shots = shots
        self.marks = EffectColumns(shots)
        self.poses = moved_by_pose(shots, self.marks.seen, self.marks.base if roughly else None)
        self.moved = np.einsum("kbi,kbi->kb", self.poses, shots.shift)  # (k, b) [m] by errors of the reference
        self.residual = unrounded(shots.measured) - self.marks.base + self.moved

    def _trust(self) -> BeamNoise:
        sd = deviations(self.shots, self.marks.seen, self.marks.base)
        smooth = self._on_smooth_path()[:, np.newaxis]
        trust = usable_readings(self.shots, self.marks.seen, self.marks.base)
        return BeamNoise(sd, 0.0, trust & smooth & self.mapped)

    def unknowns(self) -> list[Unknown]:
        """Return what stands where the map has it not, or rides with the chair."""
        riding = described(self.blocked, self.shots.measured, self.shots.laser.bearings)
        staying = list(self.map_change.unknowns())
        known = {each.covariate for each in staying}
        return [*riding, *staying, *(each for each in self.passing_objects.unknowns() if each.covariate not in known)]

    def _seen_by(self, readings: FloatArray) -> Sights:
        """Return what readings (k, b) [m] see, from where the scans are taken to be."""
        middle = readings.shape[1] // 2
        return Sights(readings, self.marks.base, self.shots.laser.bearings, self.marks.seen.origins[:, middle])

    def _on_smooth_path(self) -> BoolArray:
        """Return which scans (k,) lie where the chair's path is smooth; all where that is seldom."""
        sure = np.array([not self.kinked[self.shots.run[k]][hat.rows].any() for k, hat in enumerate(self.hats)])
        return sure if sure.mean() >= _SURE else np.ones_like(sure)

    def _sights(self) -> list[PoseEvidence]:
        """Return what each scan alone says of the errors of its poses, within what is plausible."""
        size = np.array([_BROAD.position_sd, _BROAD.position_sd, _BROAD.heading_sd])
        beam = self._begun()
        out: list[PoseEvidence] = []
        for _ in range(2):  # without outliers in the second round
            left, out = np.full_like(self.residual, np.nan), []
            for k, gram in enumerate(self.grams(beam).leads):
                own, shared, _ = self._rows(k, None)
                lead = gram.lead
                sizes = np.concatenate([np.tile(size, gram.own // 3), [_BROAD.common_sd], size])[:lead]
                errors = np.linalg.solve(gram.matrix[:lead, :lead] + np.diag(sizes**-2), gram.matrix[:lead, -1])
                left[k] = self.residual[k] - np.hstack([own, shared]) @ errors
                # What nothing fits as well as its noise allows, says less by as much.
                z = np.abs(left[k] / self.first.sd[k])[beam.valid[k]]
                width = max(SIGMA_PER_MAD * float(np.median(z)), 1.0) if len(z) else 1.0
                out.append(pose_evidence(gram, self.hats[k].rows, width, _BROAD.common_sd))
            z = np.where(self.first.valid & np.isfinite(left), np.abs(left / self.first.sd), np.inf)
            usual = np.median(z[np.isfinite(z)]) if np.isfinite(z).any() else 0.0
            beam = replace(self.first, valid=self.first.valid & (z < OUTLIER * SIGMA_PER_MAD * usual))
        return out

    def _begun(self) -> BeamNoise:
        """Return the noise of the readings before any is known, without those that are of something else."""
        size = np.array([_BROAD.position_sd, _BROAD.position_sd, _BROAD.heading_sd])
        with np.errstate(invalid="ignore"):
            reach = np.sqrt(np.sum((self.poses * size) ** 2, axis=2)) / self.first.sd
            off, moved = self.residual / self.first.sd, self.moved / self.first.sd
        return replace(self.first, valid=expected_readings(off, self.first.valid, reach, moved)[1])

    def refine(self, fitted: Sequence[Form], beam: BeamNoise, scan: ScanNoise) -> None:
        """Put in place of each fitted form's shape the one between those of the grid that explains most."""
        for form in fitted:
            best, at, columns = -np.inf, form.at, None
            for shape, some in self.marks.finer(form):
                if not np.isfinite(some[beam.valid]).all():
                    continue  # with this shape some beams meet nothing
                self.columns[:, :, form.span] = some
                use = np.concatenate([np.arange(other.span.start, other.span.stop) for other in fitted])
                gram = Stacked(self.grams(beam, use, lasting=True), self.layout).marginal(scan)[0]
                gain = float(gram[:-1, -1] @ _solve(gram[:-1, :-1], gram[:-1, -1]))
                if gain > best:
                    best, at, columns = gain, shape, some
            if columns is not None:
                self.columns[:, :, form.span] = columns
                self.forms[self.forms.index(form)] = replace(form, at=at)

    def smooth_rows(self) -> IntArray:
        """Return the scans where the chair's path is smooth.

        Where a rate jumps nobody knows just where the chair was, and readings seem to scatter far.
        """
        return np.flatnonzero(self._on_smooth_path())

    def thinned(self, rows: IntArray) -> Assembly:
        """Return some of the scans, without columns."""
        out = copy(self)
        out.shots, out.marks = some_scans(self.shots, rows), self.marks.thinned(rows)
        out.columns = np.empty((*out.shots.measured.shape, 0), dtype=np.float32)
        out.hats = [self.hats[row] for row in rows]
        out.layout = Layout(self.layout.times[rows], self.layout.run[rows], self.layout.stand[rows])
        out.motion = None if self.motion is None else [self.motion[row] for row in rows]
        out.residual, out.moved, out.poses = self.residual[rows], self.moved[rows], self.poses[rows]
        out.geometry, out.mapped = self.geometry[rows], self.mapped[rows]
        out.first = BeamNoise(self.first.sd[rows], self.first.rho, self.first.valid[rows])
        return out

    def settle(self, truth: tuple[float, float] | None, fitted: Sequence[Form] = ()) -> NormalEquations:
        """Return the normal equations with the noise estimated from these very data; fitted: forms to project out.

        Without the blocks of many columns, but for those that change whole scans.
        """
        project = self._projected(fitted)
        beam = self._begun()
        seen, layout, grid = self.marks.seen, self.layout, grid_step(self.shots.measured)
        for _ in range(_ROUNDS):
            beam = estimate_reading_noise(
                self.first, beam, lambda last: self.leftover(last, project), seen, layout, grid
            )
        narrow = max(self._fixed, self._nuisance.stop, *(free.span.stop for free in self.free if free.whole))
        grams, cross = self._crossed(beam, narrow)
        likelihood = NoiseLikelihood(grams, self.layout, project)
        scan = estimate(likelihood, truth)
        wary = with_lasting_common_mode(likelihood, scan)
        gram = without_beam_offsets(grams, cross, self.layout, wary, beam.own_sd)
        return NormalEquations(gram, scan, wary, beam, int(beam.valid.sum()))

    def _projected(self, fitted: Sequence[Form]) -> IntArray:
        """Return the columns of every effect, and of the blocks that change whole scans."""
        spans = [form.span for form in self._plain(fitted)] + [free.span for free in self.free if free.whole]
        spans.append(self._nuisance)
        return np.concatenate([np.arange(0), *(np.arange(span.start, span.stop) for span in spans)])

    def noise_beside(self, beam: BeamNoise, fitted: Sequence[Form], block: FloatArray) -> NoiseLikelihood:
        """Return how likely the noise of scans is, whatever effects on the mean there are: what these do is none.

        fitted: forms that act, with their shapes; block (k, b, m): columns that act besides.
        """
        other = copy(self)
        other.columns = np.concatenate([self.columns[:, :, self._projected(fitted)], block], axis=2, dtype=np.float32)
        return NoiseLikelihood(other.grams(beam, lasting=True), self.layout)

    def full(self, normal: NormalEquations) -> NormalEquations:
        """Return the normal equations of all columns, in the noise that is known."""
        grams, cross = self._crossed(normal.beam_noise, self.columns.shape[2])
        gram = without_beam_offsets(grams, cross, self.layout, normal.wary, normal.beam_noise.own_sd)
        return replace(normal, gram=gram)

    def again(self, settings: Sequence[EffectSetting]) -> Assembly:
        """Return the same scans predicted with effects at work, and poses sought anew; without columns."""
        shots = replace(
            self.shots,
            own=model_effects_with(self.shots, settings),
            tracks=self.tracks,
            shift=np.zeros_like(self.shots.shift),
        )
        return Assembly(shots, frozenset())

    def with_families(self, others: Sequence[FormFamily]) -> Assembly:
        """Return the same scans with columns of what effects may do instead, of which no noise is made, either."""
        out, count = copy(self), self.columns.shape[2]
        more = [each.columns(self.shots, self.marks.seen).astype(np.float32) for each in others]
        out.columns = np.concatenate([self.columns, *more], axis=2)
        out._nuisance = slice(count, out.columns.shape[2])
        return out

    def products(
        self, normal: NormalEquations, parts: Sequence[FloatArray | NDArray[np.float32]], residual: FloatArray
    ) -> FloatArray:
        """Return the normal equations of other columns (k, b, m) and another residual (k, b), in the noise known.

        parts: of these columns.
        """
        other = copy(self)
        other.columns, other.residual = np.concatenate(parts, axis=2, dtype=np.float32), residual
        known = np.isfinite(other.columns).all(axis=2) & np.isfinite(residual)
        beam = replace(normal.beam_noise, valid=normal.beam_noise.valid & known)
        grams, cross = other._crossed(beam, other.columns.shape[2])
        return without_beam_offsets(grams, cross, self.layout, normal.wary, normal.beam_noise.own_sd)

    def _crossed(self, beam: BeamNoise, count: int) -> tuple[Grams, OffsetProducts]:
        """Return the first columns' normal equations of each scan, and what single beams' offsets share with them."""
        beams = self.residual.shape[1]
        inner, common = np.zeros((beams, beams)), np.zeros((beams, count + 1))
        parts = []

        def grams() -> Iterator[Gram]:
            for k, (rows, gram) in enumerate(self._whitened(beam, np.arange(count), lasting=True)):
                products = offset_products(rows, beam.valid[k], beam.sd[k], beam.rho, inner)
                parts.append(products[:, : gram.lead].copy())
                common[:] += products[:, gram.lead :]
                yield gram

        return Grams.summed(grams()), OffsetProducts(tuple(parts), common, inner)

    def grams(self, beam: BeamNoise, columns: IntArray | None = None, *, lasting: bool = False) -> Grams:
        """Return the normal equations of each scan; columns: which of all, None for all.

        lasting: with what lasts of the errors of the poses.
        """
        return Grams.summed(gram for _, gram in self._whitened(beam, columns, lasting=lasting))

    def _whitened(
        self, beam: BeamNoise, columns: IntArray | None, *, lasting: bool
    ) -> Iterator[tuple[FloatArray, Gram]]:
        """Yield the whitened rows of each scan, and the normal equations of these and of how the chair moved."""
        for k in range(len(self.residual)):
            own, shared, common = self._rows(k, columns, lasting=lasting)
            rows = whitened(np.hstack([own, shared, common]), beam.valid[k], beam.sd[k], beam.rho)
            matrix, size = rows.T @ rows, own.shape[1]
            if size and self.motion is not None:
                steady = self.motion[k]
                matrix[:size, :size] += steady.rows.T @ steady.rows
                matrix[:size, -1] += steady.rows.T @ steady.left
                matrix[-1, :size] = matrix[:size, -1]
                matrix[-1, -1] += steady.left @ steady.left
            yield rows, Gram(matrix, size, shared.shape[1])

    def _motion(self) -> list[MotionEvidence]:
        """Return what the chair's motion says of the errors of the poses under each scan."""
        out: dict[int, MotionEvidence] = {}
        for i, (track, first) in enumerate(zip(self.shots.tracks, self.tracks, strict=True)):
            own = np.flatnonzero((self.shots.run == i) & (self.layout.stand < 0)).tolist()
            made = motion_evidence(track.times, first.poses, track.poses, [self.hats[k].rows for k in own])
            out |= dict(zip(own, made, strict=True))
        none = MotionEvidence(np.empty((0, 0)), np.empty(0))
        return [out.get(k, none) for k in range(len(self.hats))]

    def leftover(self, beam: BeamNoise, columns: IntArray) -> FloatArray:
        """Return what some columns, the poses and the common modes leave of the residual (k, b) [m].

        As much as it would be had the scan not been fitted by its own readings: a fit of six errors of poses to eight
        readings leaves little of their noise. NaN where next to nothing is left.
        """
        grams = self.grams(beam, columns)
        total = Stacked(grams, self.layout).marginal(_BROAD)[0]
        beta = _solve(total[:-1, :-1], total[:-1, -1])
        out: FloatArray = np.empty_like(self.residual)
        for k, gram in enumerate(grams.leads):
            own, shared, common = self._rows(k, columns)
            random, lead = np.hstack([own, shared]), gram.lead
            target = gram.matrix[:lead, -1] - gram.matrix[:lead, lead:-1] @ beta
            fitted = np.where(beam.valid[k][:, np.newaxis], random, 0.0)
            solved = _solve(gram.matrix[:lead, :lead], np.column_stack([target, fitted.T]))
            kept = 1 - np.einsum("bq,qb->b", fitted, solved[:, 1:]) / beam.sd[k] ** 2
            kept = np.where(kept > _KEPT, kept, np.nan)
            out[k] = (common[:, -1] - common[:, :-1] @ beta - random @ solved[:, 0]) / np.sqrt(kept)
        return out

    def _plain(self, fitted: Sequence[Form]) -> list[Form]:
        """Return a form per effect: the fitted one, else the one in the middle of its grid."""
        chosen = {form.id: form for form in fitted}
        by_id: dict[str, list[Form]] = {}
        for form in self.forms:
            by_id.setdefault(form.id, []).append(form)
        return [chosen.get(name, forms[len(forms) // 2]) for name, forms in by_id.items()]

    def _rows(
        self, k: int, columns: IntArray | None, *, lasting: bool = False
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        poses = self.poses[k]
        one = np.ones((poses.shape[0], 1))
        common = self.columns[k] if columns is None else self.columns[k][:, columns]
        last = np.column_stack([common, self.residual[k]])
        if self.layout.stand[k] >= 0:
            return np.empty((len(one), 0)), np.hstack([one, poses]), last
        own = (self.hats[k].weights[:, :, np.newaxis] * poses[:, np.newaxis, :]).reshape(len(one), -1)
        return own, np.hstack([one, poses]) if lasting else one, last

    def random_columns(self, k: int) -> FloatArray:
        """Return (b, q) what the readings of a scan do by its common mode and by errors of its reference poses.

        Three for what those errors have in common, x, y, yaw, then three for each of them.
        """
        own, shared, _ = self._rows(k, np.arange(0), lasting=True)
        return np.hstack([shared, own])

    def random_sds(self, k: int, noise: ScanNoise) -> FloatArray:
        """Return the sds (q,) [m, rad] of what random_columns are of."""
        if self.layout.stand[k] >= 0:
            return np.concatenate([[noise.common_sd], pose_sds(noise)])
        own = np.tile(own_pose_sds(noise), self.hats[k].weights.shape[1])
        return np.concatenate([[noise.common_sd], lasting_sds(noise), own])


def _solve(gram: FloatArray, target: FloatArray) -> FloatArray:
    norms = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    inside = gram / np.outer(norms, norms) + 1e-9 * np.eye(len(gram))
    return np.asarray((np.linalg.solve(inside, (target.T / norms).T).T / norms).T)
