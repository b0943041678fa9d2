# SPDX-License-Identifier: BSD-3-Clause
"""What the laser does: optics, clock, mount and receiver, from the pose of each beam to a reading."""

from collections import namedtuple
from typing import Any, Callable
import numpy as np
from kurumaisu.bench.strangers.fell.plant import Cause
from kurumaisu.bench.strangers.fell.room import Room

XYA, P0, REACH0, MISS0 = ("x", "y", "yaw"), 0.002, 0.05, 0.002  # rare large errors and lost beams that any laser has
FANS = {
    "UTM-30LX": (270, 361, 0.025, (0.006, 0.0002, 0.0), 0.1, 30.0),  # degrees, beams, s, sigma, near, far
    "LMS200": (180, 181, 0.0133, (0.006, 0.0003, 0.0), 0.1, 20.0),
    "A1": (360, 360, 0.15, (0.003, 0.001, 0.0002), 0.15, 12.0),
    "LDS-01": (360, 360, 0.2, (0.005, 0.001, 0.0008), 0.12, 8.0),
    "TIM561": (270, 271, 0.067, (0.01, 0.0, 0.0001), 0.05, 10.0),
    "S300": (270, 271, 0.04, (0.008, 0.0004, 0), 0.1, 25.0),
}

# a laser: fan, timing, error and place
Laser = namedtuple(
    "Laser", "name angle_min increment beams scan_time tinc sigma near far period mount scale datum height"
)


def draw_laser(rng: np.random.Generator, chair: bool) -> Laser:
    """One of those that are on robots."""
    mx, my = round(float(rng.uniform(0.05, 0.22)), 3), round(float(rng.choice([0, 0, 0.03])), 3)
    per = float(rng.choice([0.5, 0.8, 1.0]))
    if chair and rng.random() < 0.7:
        return Laser(
            "URG-04LX",
            -2.086214,
            0.006135923,
            682,
            0.1,
            9.765625e-5,
            (0.002334, -0.000488, 0.000199),
            0.06,
            4.0,
            per,
            (0.30, 0.0, 0.0),
            1.004587,
            float(rng.choice([0.0, 0.058826])),
            0.4,
        )
    name = str(rng.choice(list(FANS)))
    fov, k, full, sigma, near, far = FANS[name]
    yaw = float(rng.choice([0.0, 0.0, 0.1])) if fov == 360 else 0.0
    return Laser(
        name,
        round(-np.radians(fov) / 2, 7),
        round(np.radians(fov) / (k - (fov < 360)), 9),
        k,
        full,
        round(full * fov / 360 / k, 9),
        sigma,
        near,
        far,
        per,
        (mx, my, yaw),
        1.0,
        0.0,
        0.4,
    )


def readings(
    las: Laser,
    room: Room,
    causes: list[Cause],
    pose: Callable,
    stamps: np.ndarray,
    ctx: dict[str, Any],
    beams: np.ndarray | None = None,
) -> dict[str, np.ndarray]:
    """Mean, scatter, losses and outliers of each beam of the scans stamped so. ctx: temperature, humidity, way."""
    c = {k.id: k for k in causes}
    g = lambda i, k: c[i].p[k] if i in c else 0.0  # noqa: E731
    alt = lambda i: i in c and c[i].other  # noqa: E731
    i = np.arange(las.beams) if beams is None else beams
    taken = stamps - g("laser.latency", "delay") * (1 + 0.4 * np.sin(stamps * 0.9) * alt("laser.latency"))
    taken = taken - g("laser.clock_skew", "skew") * stamps * (0.5 + stamps / 240 if alt("laser.clock_skew") else 1)
    late = i * las.tinc * (1 + g("laser.sweep", "stretch") * (0.7 + 0.6 * i / las.beams if alt("laser.sweep") else 1))
    x, y, th = pose(taken[:, None] + late)
    b = las.angle_min + i * las.increment
    # a loose bracket (the other form of a mount) gives a little while the base turns
    give = lambda k: 1 + 0.25 * np.tanh(2 * ctx["w"](stamps))[:, None] if alt(k) else 1.0  # noqa: E731
    lx, ly, yaw = (m + g("laser.mount_" + k, k) * give("laser.mount_" + k) for m, k in zip(las.mount, XYA))
    ang = th + b + yaw
    ox, oy = x + np.cos(th) * lx - np.sin(th) * ly, y + np.sin(th) * lx + np.cos(th) * ly
    if k := c.get("world.map_error"):
        room = room.shifted(k.p["sd"], np.random.default_rng(k.p["seed"]), k.other)
    r, seg = room.cast(ox, oy, ang)
    ex, ey = (room.walls[seg, j + 2] - room.walls[seg, j] for j in (0, 1))
    ca, sa = np.cos(ang), np.sin(ang)
    s = np.sign(ca * ey - sa * ex) / np.hypot(ex, ey)
    nx, ny = ey * s, -ex * s  # normals away from the laser
    cosi = np.maximum(nx * ca + ny * sa, 0.03)
    inc = np.minimum(np.arccos(np.minimum(cosi, 1)), 1.4)
    dark = room.dark[room.owner[seg]]
    hx, hy = ox + r * ca, oy + r * sa
    jac = np.stack([-nx / cosi, -ny / cosi, (nx * (hy - y) - ny * (hx - x)) / cosi], -1)
    q, t = r, stamps[:, None]
    if k := c.get("laser.tilt"):
        eps = k.p["pitch"] * np.cos(b) + k.p["roll"] * np.sin(b)
        eps = eps * (1 + 0.3 * np.sin(1.1 * t) * k.other)  # other: it nods with the floor
        q = np.minimum(r / np.cos(eps), las.height / np.maximum(np.sin(eps), 1e-6) * np.ones_like(r))
    mu = las.scale * q + las.datum
    mu = mu + g("laser.offset", "offset") * (1 + 0.5 * np.exp(-q) * alt("laser.offset"))
    mu = mu + g("laser.scale", "scale") * q * ((q / 3) ** 0.3 if alt("laser.scale") else 1)
    mu = mu + g("laser.quadratic", "quadratic") * (1.8 * q**1.6 if alt("laser.quadratic") else q * q)
    if k := c.get("laser.warmup"):
        f = np.exp(-t / k.p["tau"])
        mu = mu + k.p["amplitude"] * (0.6 * f**2.5 + 0.4 * f**0.5 if k.other else f)
    if k := c.get("laser.temperature"):
        mu = mu + k.p["coefficient"] * (ctx["temperature"](t - 50 * k.other) - 20)
    if k := c.get("laser.cyclic"):
        ph = 2 * np.pi * q / k.p["wavelength"] + k.p["phase"]
        mu = mu + k.p["amplitude"] * (np.sin(ph) + 0.3 * np.sin(2 * ph) * k.other)
    if k := c.get("laser.incidence_bias"):
        mu = mu + k.p["k"] * (2 * inc**3 if k.other else np.tan(inc))
    if k := c.get("laser.reflectance"):
        mu = mu + k.p["bias"] * dark * ((q / 3) ** 0.5 if k.other else 1)
    if k := c.get("laser.beam_bias"):
        own, u = np.random.default_rng(k.p["seed"]).standard_normal(las.beams), np.linspace(0, 2 * np.pi, las.beams)
        mu = mu + k.p["sd"] * (np.sin(u + own[0]) + 0.5 * np.sin(3 * u + own[1]) if k.other else own)[i]
    sig = np.polyval(las.sigma[::-1], q)
    share = g("laser.range_noise", "share")
    sig = np.maximum(sig * (1 + share + 0.5 * share * (q / 3 - 1) * alt("laser.range_noise")), 1e-4)
    if k := c.get("laser.incidence_noise"):
        sig = sig * (1 + k.p["gain"] * (1.25 * inc**2.5 if k.other else np.tan(inc)))
    sig = sig * (1 + 0.5 * dark * ("laser.reflectance" in c))
    for k in causes:
        if k.id in ("unknown.laser.range", "unknown.laser.spread"):
            p = k.p
            f = (
                p["a"]
                * {
                    "humidity": lambda: (ctx["humidity"](t) - 45) / 8,
                    "direction": lambda: np.cos(2 * ang + p["f"]),
                    "hit_x": lambda: np.sin(p["k"] * hx + p["f"]),
                    "hit_y": lambda: np.sin(p["k"] * hy + p["f"]),
                    "abs_v": lambda: np.abs(ctx["v"](t)),
                    "abs_w": lambda: np.abs(ctx["w"](t)),
                    "time": lambda: (t / p["period"] + p["f"]) % 1 < 0.3,
                }[p["of"]]()
            )
            mu, sig = (mu + f, sig) if k.id == "unknown.laser.range" else (mu, sig * np.exp(np.clip(f, -1.5, 1.5)))
    miss, out = np.full(r.shape, MISS0), np.full(r.shape, P0)
    if k := c.get("laser.dropout"):
        miss = miss + k.p["probability"] * (np.minimum(0.4 + 0.2 * q + 0.4 * dark, 1.1) if k.other else 1)
    jump, before, after = np.zeros_like(r), np.roll(r, 1, 1) - r, np.roll(r, -1, 1) - r
    step = np.where(np.abs(before) > np.abs(after), before, after)
    jump[:, 1:-1] = (step * (np.abs(step) > np.maximum(0.15, 8 * las.increment * r / cosi)))[:, 1:-1]
    return {
        "mu": mu,
        "sig": sig,
        "miss": miss,
        "jump": jump,
        "jac": jac,
        "out": out + g("laser.heavy_tails", "outliers") * (not alt("laser.heavy_tails")),
        "mixed": g("laser.mixed_pixels", "probability") * (jump != 0),
        "cross": np.full(len(stamps), g("laser.crosstalk", "probability")),
    }


def sample(
    las: Laser, causes: list[Cause], rd: dict[str, np.ndarray], stamps: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Readings with their noise, steps and gate: nan lost, inf no return."""
    c = {k.id: k for k in causes}
    K, n = rd["mu"].shape
    e, tails = rng.standard_normal((K, n)), c.get("laser.heavy_tails")
    if k := c.get("laser.beam_correlation"):
        rho = k.p["rho"]
        if k.other:  # a smoothing receiver: three neighbours, nothing beyond
            e = (e + rho * np.roll(e, 1, 1) + rho * np.roll(e, -1, 1)) / np.sqrt(1 + 2 * rho * rho)
        for j in range(1, 0 if k.other else n):
            e[:, j] = rho * e[:, j - 1] + np.sqrt(1 - rho * rho) * e[:, j]
    if tails and tails.other:
        e = rng.standard_t(3.2, (K, n)) / np.sqrt(3.2 / 1.2)
    z, gone = rd["mu"] + rd["sig"] * e, rng.random((K, n)) < rd["miss"]
    if k := c.get("laser.common_mode"):
        a, rho = 0.0, k.p["rho"]
        for j in range(K):
            a = rho * a + np.sqrt(1 - rho * rho) * (rng.uniform(-1.7, 1.7) if k.other else rng.standard_normal())
            z[j] += k.p["sd"] * a
    z = z + (rng.random((K, n)) < rd["out"]) * (tails.p["reach"] if tails else REACH0) * rng.standard_normal((K, n))
    z = np.where(rng.random((K, n)) < rd["mixed"], z + rd["jump"] * rng.random((K, n)), z)
    if k := c.get("laser.crosstalk"):
        at, b = rng.uniform(-2, 2), las.angle_min + np.arange(n) * las.increment
        for j in np.flatnonzero(rng.random(K) < rd["cross"]):
            mid = (at + k.p["drift"] * stamps[j] + np.pi) % (2 * np.pi) - np.pi
            hit = np.abs(b - mid) < k.p["width"] / 2 * (rng.uniform(0.3, 1.7) if k.other else 1)
            z[j, hit] = rng.uniform(las.near, k.p["reach"], hit.sum())
    if k := c.get("laser.quantisation"):
        z = k.p["step"] * (np.floor(z / k.p["step"]) + 0.5 if k.other else np.round(z / k.p["step"]))
    z = np.round(z, 3)
    if k := c.get("laser.saturation"):
        z = np.minimum(z, 1 / k.p["inverse_far"])
    return np.where(gone | (z < las.near), np.nan, np.where(z > las.far, np.inf, z))


def clipped(causes: list[Cause], rd: dict[str, np.ndarray]) -> np.ndarray:
    """Mean readings after steps and cut."""
    mu = rd["mu"]
    for k in causes:
        if k.id == "laser.quantisation":
            s, w = k.p["step"], 2 * np.pi / k.p["step"]
            mu = mu + s / np.pi * np.exp(-((w * rd["sig"]) ** 2) / 2) * np.sin(w * mu) * (1 if k.other else -1)
        if k.id == "laser.saturation":
            mu = np.minimum(mu, 1 / k.p["inverse_far"])
    return mu
