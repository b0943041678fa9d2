# SPDX-License-Identifier: BSD-3-Clause
"""What the viewer shows of a recording: its runs as tapes, with the simulated drives beside the measured one."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kurumaisu import geometry
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.covariates import with_covariates
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.base.replay import PICTURE, RESTART, restarted_path
from kurumaisu.critic.data.bag_reader import resolve
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.excerpt import span
from kurumaisu.critic.data.meta import Meta, recording_of_meta
from kurumaisu.critic.data.reading import check_run, chosen, meta_of, read_run, sources
from kurumaisu.critic.ranges.scans.gathering import laser_of
from kurumaisu.critic.ranges.scans.walls import Rays, walls_at
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.errors import Error, one_line
from kurumaisu.params import Laser, Model
from kurumaisu.types import FloatArray
from kurumaisu.viewer.playback import CHAIR
from kurumaisu.viewer.protocol import Body, Fan, Note, World
from kurumaisu.viewer.tape import Held, Tape, Track
from kurumaisu.world import World as Map

# Bodies of simulated drives, by id: name and colour, those of the report's pictures.
SIMULATED = {"model": ("original model", "#c04a00"), "extended": ("extended model", "#0072b2")}
_IMPOSSIBLE = 20.0  # [m/s] beyond which odometry was not driven but set
_MOST_NOTES = 50
_MARGIN = 1.0  # [m] around what there is to see
_NOWHERE = Fan((0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0, ())  # nobody knows where that scan was taken
_PARTS = ("command", "voltage", "pose", "odom", "scan")
Floats = NDArray[np.float32]
_TYPE = np.dtype(np.float32)  # as in a bag; at 4 m good to a micrometre


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
        bodies = []
        if self._map is not None:
            segments = tuple((a, b, c, d) for a, b, c, d in np.round(self._map.segments, 4).tolist())
            bodies.append(Body("walls", self._map.name, "wall", "#404040", False, segments=segments))
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


@dataclass(frozen=True)
class Scans:
    """Scans of a run. series: numbers in the spool; path: where the chair was, None: nobody knows, it stands at 0.

    rays: of the map, None where there is none, or the path is not in its frame.
    """

    series: Series
    spool: Spool
    laser: Laser
    path: Track | None
    rays: Rays | None

    def fan(self, number: int) -> Fan:
        """Return a scan, with the error of each reading where the map is known."""
        laser, t = self.laser, float(self.series.t[number])
        mount = np.array([laser.mount.x, laser.mount.y, laser.mount.yaw])
        base = (0.0, 0.0, 0.0) if self.path is None else self.path.at(t)
        if base is None:
            return _NOWHERE
        read, intensities = self.spool.get(int(self.series.values[number, 0]))
        ranges = np.asarray(read, dtype=np.float64)
        x, y, yaw = geometry.compose(np.array(base), mount).tolist()
        error = None if self.rays is None or self.path is None else ranges - self._true(t, mount, self.path, self.rays)
        return Fan(
            pose=(x, y, yaw),
            angle_min=laser.angle_min,
            angle_increment=laser.angle_increment,
            range_min=laser.range_min,
            range_max=laser.range_max,
            ranges=ranges,
            error=None if error is None else np.where(np.isfinite(error), error, np.nan),
            intensities=intensities,
        )

    def _true(self, t: float, mount: FloatArray, path: Track, rays: Rays) -> FloatArray:
        """Return the ranges (b,) in the map, each beam cast from where the laser was when it was fired."""
        laser = self.laser
        times = t + laser.time_increment * np.arange(laser.beams)
        poses = geometry.compose(geometry.interpolate(path.times, path.poses, times), mount)
        return rays.ranges(poses, laser.bearings)


@dataclass(frozen=True)
class Album:
    """A recording whose scans have a number for their only value, by which their run's spool gives the ranges."""

    recording: Recording
    spools: dict[str, Spool]


def read_album(path: Path, wanted: Sequence[str]) -> Album:
    """Read runs as the critic does, each with its scans put aside; wanted: their names or patterns, empty takes all.

    Raise Error for what cannot be read, and where there is nothing to look at.
    """
    meta = meta_of(path)
    faults, spools, runs, laser = Faults(), {}, [], meta.laser
    for source in chosen(sources(path), wanted):
        spool = Spool()
        run, mount = read_run(source, meta, faults, spool.put)
        laser = laser or mount
        run = _put_aside(run, spool)
        if not run.parts(*_PARTS):
            faults.add(f"{run.name}: has nothing to look at: {_needed(meta)}")
            continue
        check_run(replace(run, scan=None), None, faults)
        spools[run.name] = spool
        runs.append(run)
    if not runs:
        raise Error("; ".join([f"{path}: has nothing to look at: {_needed(meta)}", *faults.notes[:3]]))
    name = path.resolve().stem if path.is_file() else path.resolve().name
    train = tuple(run.name for run in runs)
    meta = replace(meta, laser=laser, robot=None, notes=())
    return Album(recording_of_meta(name, runs, meta, faults, train=train, test=()), spools)


def _needed(meta: Meta) -> str:
    topics = resolve(meta.topics)
    return "none of " + ", ".join(f"{name}.csv or {topics[name]}" for name in _PARTS)


def _put_aside(run: Run, spool: Spool) -> Run:
    """Return a run whose scans are in the spool: those of tables and rawlogs come whole."""
    if run.scan is None or run.scan.columns == ("row",):
        return run
    rows = np.array([[spool.put(ranges)] for ranges in run.scan.values], dtype=np.float64)
    return replace(run, scan=Series(run.scan.t, rows, ("row",)))


class Spool:
    """Scans in a temporary file that is gone with the program; all like the first, with intensities or without."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(prefix="kurumaisu_scans_")  # noqa: SIM115
        self._beams = -1
        self._rows = 1  # of a scan: ranges, and intensities, too
        self._count = 0

    def put(self, ranges: FloatArray, intensities: FloatArray | None = None) -> int:
        """Put a scan's ranges and intensities (b,) aside; return its number, -1 where it is not as long as the first.

        Raise Error when there is no room.
        """
        if self._beams < 0:
            self._beams = len(ranges)
            self._rows = 1 if intensities is None else 2
        if len(ranges) != self._beams:
            return -1
        rows = np.full((self._rows, self._beams), np.nan, dtype=_TYPE)
        rows[0] = ranges
        if intensities is not None:
            rows[1:] = intensities
        try:
            self._file.write(rows.tobytes())
        except OSError as error:
            raise Error(
                f"{tempfile.gettempdir()}: {error.strerror}: no room for scans; TMPDIR names another"
            ) from error
        self._count += 1
        return self._count - 1

    def get(self, number: int) -> tuple[Floats, Floats | None]:
        """Return the ranges of a scan, and its intensities if there are any."""
        assert 0 <= number < self._count
        size = self._rows * self._beams * _TYPE.itemsize
        self._file.flush()
        rows = np.frombuffer(os.pread(self._file.fileno(), size, number * size), dtype=_TYPE).reshape(self._rows, -1)
        return rows[0], rows[1] if len(rows) > 1 else None
