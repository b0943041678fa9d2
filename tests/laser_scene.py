# SPDX-License-Identifier: BSD-3-Clause
"""Scans of a room by rays of numpy and errors of other forms than the package's: for tests of the laser's criticism."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from kurumaisu.critic.values.recording import LaserMount, Recording, Run, Series

BEAMS, FIRST, INCREMENT, BEAM_TIME = 682, -2.086214, 0.006135923, 9.765625e-5
# name, middle, size [m], degrees, ranger_return
BOXES = (
    ("south", 3.0, -0.05, 6.2, 0.1, 0, 1.0),
    ("north", 3.0, 5.05, 6.2, 0.1, 0, 1.0),
    ("west", -0.05, 2.5, 0.1, 5.0, 0, 1.0),
    ("east", 6.05, 2.5, 0.1, 5.0, 0, 1.0),
    ("cupboard", 5.7, 3.9, 0.6, 1.2, 0, 0.4),
    ("bed", 0.95, 4.2, 0.9, 0.5, 30, 1.0),
    ("chest", 4.4, 0.7, 0.5, 0.4, 20, 0.4),
)


def write_world(path: Path) -> Path:
    boxes = [
        f'm ( name "{n}" pose [{x} {y} 0 {a}] size [{w} {h} 1.0] ranger_return {r} )\n' for n, x, y, w, h, a, r in BOXES
    ]
    path.write_text('name "test"\ndefine m model ( gui_move 0 )\n' + "".join(boxes))
    return path


def sides():
    out = []
    for _, x, y, w, h, a, _ in BOXES:
        c, s = np.cos(np.radians(a)), np.sin(np.radians(a))
        corners = np.array([[-w, -h], [w, -h], [w, h], [-w, h]]) / 2 @ np.array([[c, s], [-s, c]]) + [x, y]
        out.append(np.hstack([corners, np.roll(corners, -1, axis=0)]))
    return np.concatenate(out)


def cast(origins, angles):
    """Ranges, incidences and sides met, by the crossing of two lines."""
    walls = sides()
    d = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    best, which = np.full(len(angles), np.inf), np.zeros(len(angles), dtype=int)
    for i, (x0, y0, x1, y1) in enumerate(walls):
        ex, ey = x1 - x0, y1 - y0
        with np.errstate(divide="ignore", invalid="ignore"):
            cross = d[:, 0] * ey - d[:, 1] * ex
            t = ((x0 - origins[:, 0]) * ey - (y0 - origins[:, 1]) * ex) / cross
            u = ((x0 - origins[:, 0]) * d[:, 1] - (y0 - origins[:, 1]) * d[:, 0]) / cross
        nearer = (t > 0) & (u > -1e-9) & (u < 1 + 1e-9) & (t < best)
        best, which = np.where(nearer, t, best), np.where(nearer, i, which)
    along = walls[which, 2:] - walls[which, :2]
    normal = np.stack([along[:, 1], -along[:, 0]], axis=-1) / np.linalg.norm(along, axis=1, keepdims=True)
    return best, np.arccos(np.clip(np.abs((normal * d).sum(axis=1)), 0, 1)), which // 4


def way(rng):
    """A drive about the room: poses as a function of time."""
    a, b, c, d = rng.uniform(0, 2 * np.pi, 4)
    return lambda t: np.stack(
        [
            2.9 + np.sin(0.11 * t + a) + 0.3 * np.sin(0.31 * t + b),
            2.3 + 0.8 * np.sin(0.13 * t + c),
            3 * np.sin(0.09 * t + d) + 0.2 * t * np.sin(a) + 0.5 * np.sin(0.45 * t),
        ],
        axis=-1,
    )


def mean_reading(effect, size, r, incidence, box, bearings, t, span):
    """Equation (4) with an effect on the mean."""
    reflectance = np.array([b[6] for b in BOXES])[box]
    extra = {
        "laser.offset": lambda: size,
        "laser.scale": lambda: size * r,
        "laser.quadratic": lambda: size * r * r,
        "laser.warmup": lambda: size / (1 + 3 * t / span) ** 2,
        "laser.temperature": lambda: size * np.sin(2 * np.pi * t / (span / 2.3)),
        "laser.cyclic": lambda: size * (np.sin(2 * np.pi * r / 1.45 + 0.8) + 0.05 * np.sin(4 * np.pi * r / 1.45)),
        "laser.incidence_bias": lambda: size * 0.5 * np.tan(np.minimum(incidence, 1.3)) ** 2,
        "laser.reflectance": lambda: size * (reflectance < 0.9),
        "laser.beam_bias": lambda: size * np.cos(bearings + 0.5),
        "laser.tilt": lambda: 0.5 * r * (size * np.cos(bearings - 0.7)) ** 2,
    }
    return 1.004587 * r + 0.058826 + extra.get(effect, lambda: 0.0)()


def neighbours(rng, rho, scans):
    z = rng.standard_normal((scans, BEAMS))
    for i in range(1, BEAMS):
        z[:, i] = rho * z[:, i - 1] + np.sqrt(1 - rho**2) * z[:, i]
    return z


def common_modes(rng, sd, gap, scans):
    out = sd * rng.standard_normal(scans)
    keep = np.exp(-gap / 2.0)
    for k in range(1, scans):
        out[k] = keep * out[k - 1] + np.sqrt(1 - keep**2) * out[k]
    return out


def recording(folder, effect, size, seed, scans=50, *, rho=0.0, common=0.0, truth=0.003, told=True):
    """A drive through the room whose laser has one effect, of any kind; the null: effect None."""
    rng = np.random.default_rng(seed)
    gap, at = 0.4, way(rng)
    span = scans * gap + 1
    bearings = FIRST + INCREMENT * np.arange(BEAMS)
    mount = [0.30, 0.0, 0.0]
    names = ["laser.mount_x", "laser.mount_y", "laser.mount_yaw"]
    if effect in names:
        mount[names.index(effect)] += size
    noise = neighbours(rng, size if effect == "laser.beam_correlation" else rho, scans)
    shared = common_modes(rng, size if effect == "laser.common_mode" else common, gap, scans)
    stamps = 0.05 + gap * np.arange(scans)
    out = []
    for k, stamp in enumerate(stamps):
        late = size if effect == "laser.latency" else 0.0
        poses = at(stamp - late + BEAM_TIME * np.arange(BEAMS))
        c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        origins = poses[:, :2] + np.stack([c * mount[0] - s * mount[1], s * mount[0] + c * mount[1]], axis=-1)
        r, incidence, box = cast(origins, poses[:, 2] + mount[2] + bearings)
        sd = 0.002334 - 0.000488 * r + 0.000199 * r * r
        if effect == "laser.range_noise":
            sd = sd * np.sqrt(1 + size)
        row = mean_reading(effect, size, r, incidence, box, bearings, stamp, span) + sd * noise[k] + shared[k]
        step = size if effect == "laser.quantisation" else 0.001
        row = np.round(np.round(row / step) * step, 3)
        if effect == "laser.dropout":
            row[rng.random(BEAMS) < size] = np.nan
        if effect == "laser.heavy_tails":
            row += np.where(rng.random(BEAMS) < size, 0.3 * rng.standard_normal(BEAMS), 0.0)
        row[row < 0.06] = np.nan
        row[row > 4.0] = np.inf
        out.append(row)
    times = np.arange(0, span, 0.05)
    poses = at(times) + truth * rng.standard_normal((len(times), 3))
    run = Run(
        "drive",
        pose=Series(times, poses, ("x", "y", "theta")),
        scan=Series(stamps, np.array(out), tuple(f"r{i}" for i in range(BEAMS))),
    )
    return Recording(
        "test",
        (run,),
        ("drive",),
        world=write_world(folder / "test.world"),
        laser=LaserMount(0.30, 0.0, 0.0, FIRST, INCREMENT, BEAMS),
        truth=(truth, truth) if told else None,
    )


def sparse(data, every=3, scans=1):
    """Return a recording with some of the beams, and of the scans: as good for what is loud, and sooner done."""
    laser = data.laser
    between = BEAM_TIME if laser.time_increment is None else laser.time_increment
    names = data.runs[0].scan.columns[::every]
    runs = tuple(
        replace(run, scan=Series(run.scan.t[::scans], run.scan.values[::scans, ::every], names)) for run in data.runs
    )
    fan = replace(
        laser,
        angle_increment=every * laser.angle_increment,
        beams=len(names),
        time_increment=every * between,
    )
    return replace(data, runs=runs, laser=fan)
