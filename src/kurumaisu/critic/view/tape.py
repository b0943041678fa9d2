# SPDX-License-Identifier: BSD-3-Clause
"""What the viewer shows of a recording: its runs as tapes, with the simulated drives beside the measured one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.covariates import with_covariates
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.base.replay import PICTURE, RESTART, restarted_path
from kurumaisu.critic.ranges.scans.gathering import laser_of
from kurumaisu.critic.ranges.scans.walls import Rays, walls_at
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.critic.view.album import Album, span
from kurumaisu.critic.view.scans import Scans
from kurumaisu.errors import Error, one_line
from kurumaisu.params import Model
from kurumaisu.types import FloatArray
from kurumaisu.viewer.playback import CHAIR
from kurumaisu.viewer.protocol import Body, Note, World
from kurumaisu.viewer.tape import Held, Tape, Track
from kurumaisu.world import World as Map

# Bodies of simulated drives, by id: name and colour, those of the report's pictures.
SIMULATED = {"model": ("original model", "#c04a00"), "extended": ("extended model", "#0072b2")}
_IMPOSSIBLE = 20.0  # [m/s] beyond which odometry was not driven but set
_MOST_NOTES = 50
_MARGIN = 1.0  # [m] around what there is to see


class Showing:
    """A recording with the models that it is compared with, by ids of SIMULATED; place: its map, if it has one."""

    def __init__(self, album: Album, models: Mapping[str, Model], place: Map | None) -> None:
        self._album, self._models, self._map = album, models, place
        self._tapes: dict[str, Tape] = {}
        first = next(iter(models.values()))
        self._chassis, self._laser = first.chassis, first.laser
        self._rays = None if place is None else Rays(walls_at(place, self._laser.mount.z))
        self._mount = album.recording.laser

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of the runs."""
        return tuple(run.name for run in self._album.recording.runs)

    def world(self) -> World:
        """Return the bodies of all runs: the map, the chair and the simulated ones."""
        c = self._chassis
        front, rear, side = c.axle_to_front, c.axle_to_front - c.length, c.width / 2
        outline = ((front, side), (rear, side), (rear, -side), (front, -side))
        bodies = [] if self._map is None else [_walls(self._map)]
        for name in self._models:
            said, color = SIMULATED[name]
            bodies.append(Body(name, said, "robot", color, False, (outline,)))
        bodies.append(Body(CHAIR, "measured", "robot", "#606870", False, (outline,)))  # above the others
        return World(tuple(bodies), self._bounds(), CHAIR)

    def tape(self, name: str) -> Tape:
        """Return a run, simulated by the models; the second time, the same."""
        if name not in self._tapes:
            self._tapes[name] = self._made(name)
        return self._tapes[name]

    def _made(self, name: str) -> Tape:
        recording = self._album.recording
        run = next(run for run in recording.runs if run.name == name)
        notes = [Note("error" if said in recording.invalid else "warning", said) for said in recording.problems]
        truth = None if run.pose is None else Track(run.pose.t, run.pose.values[:, :3])
        odom = None if run.odom is None else Track(run.odom.t, laid(run.odom, truth))
        tracks = self._simulated(run, notes) if truth is not None else {}
        path = truth or odom
        scans = self._scans(run, truth, path, notes)
        if truth is None:
            told = "odometry serves, from where it began" if odom else "the chair is drawn nowhere, its scans at 0, 0"
            notes.append(Note("info", f"{name}: no reference pose was recorded: {told}"))
        begin, end = span(run)
        return Tape(
            name=name,
            begin=begin,
            end=end,
            truth=truth,
            odom=odom,
            tracks=tracks,
            rates=_held(run.odom, ("v", "w")),
            asked=_held(run.command, ("v", "w")),
            volts=_held(run.voltage, ("v_f", "v_s")),
            scan_times=np.empty(0) if scans is None else scans.series.t,
            fan=None if scans is None else scans.fan,
            notes=tuple(notes[:_MOST_NOTES]),
        )

    def _simulated(self, run: Run, notes: list[Note]) -> dict[str, Track]:
        tracks: dict[str, Track] = {}
        try:
            for name, model in self._models.items():
                drive = with_covariates(prepare(run, model, PICTURE), run)
                pieces = list(restarted_path(drive, replay.path(drive, model, ())))
                times = np.concatenate([drive.times[rows] for rows, _ in pieces])
                tracks[name] = Track(times, np.concatenate([poses for _, poses in pieces]))
        except Error as error:
            notes.append(Note("info", f"not simulated: {one_line(error)}"))
        if tracks:
            told = f"simulated drives restart at the measured pose every {RESTART:g} s, as in the report"
            notes.append(Note("info", told))
        return tracks

    def _scans(self, run: Run, truth: Track | None, path: Track | None, notes: list[Note]) -> Scans | None:
        if run.scan is None:
            return None
        spool = self._album.spools[run.name]
        laser = laser_of(self._laser, self._mount, [run])
        beams = len(spool.get(int(run.scan.values[0, 0]))[0])
        if beams != laser.beams:
            said = (
                f"{run.name}: scans of {beams} beams are not shown: the laser has {laser.beams}; say laser in meta.yaml"
            )
            notes.append(Note("warning", said))
            return None
        if self._rays is None or truth is None:
            missing = "a map: say world in meta.yaml" if self._rays is None else "the reference pose"
            notes.append(Note("info", f"{run.name}: scans have no range error without {missing}"))
        return Scans(run.scan, spool, laser, path, self._rays if truth is not None else None)

    def _bounds(self) -> tuple[float, float, float, float] | None:
        runs = self._album.recording.runs
        places = [series.values[:, :2] for run in runs if (series := run.pose or run.odom) is not None]
        if self._map is not None:
            places.append(self._map.segments.reshape(-1, 2))
        every = np.concatenate([*places, np.empty((0, 2))])
        if not len(every):
            return None
        (x0, y0), (x1, y1) = every.min(axis=0).tolist(), every.max(axis=0).tolist()
        return x0 - _MARGIN, y0 - _MARGIN, x1 + _MARGIN, y1 + _MARGIN


def laid(odom: Series, truth: Track | None) -> FloatArray:
    """Return odometry's poses (n, 3) laid on the truth where it began, and again where it was set to another pose."""
    poses = odom.values[:, :3]
    if truth is None:
        return poses
    out = poses.copy()
    for rows in _driven(odom.t, poses):
        known = ((i, pose) for i in range(rows.start, rows.stop) if (pose := truth.at(float(odom.t[i]))) is not None)
        first = next(known, None)
        if first is not None:
            out[rows] = geometry.compose(np.array(first[1]), geometry.between(poses[first[0]], poses[rows]))
    return out


def _driven(times: FloatArray, poses: FloatArray) -> Iterator[slice]:
    """Yield the rows between which nobody set the odometry."""
    with np.errstate(divide="ignore"):
        speed = np.hypot(*np.diff(poses[:, :2], axis=0).T) / np.diff(times)
    cuts = [0, *(np.flatnonzero(speed > _IMPOSSIBLE) + 1).tolist(), len(times)]
    yield from (slice(a, b) for a, b in pairwise(cuts))


def _held(series: Series | None, columns: tuple[str, str]) -> Held | None:
    if series is None:
        return None
    return Held(series.t, np.column_stack([series.column(name) for name in columns]))


def _walls(place: Map) -> Body:
    segments = tuple((a, b, c, d) for a, b, c, d in np.round(place.segments, 4).tolist())
    return Body("walls", place.name, "wall", "#404040", False, segments=segments)
