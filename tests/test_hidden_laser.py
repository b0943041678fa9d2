# SPDX-License-Identifier: BSD-3-Clause
"""The generator of hidden faults of the laser: its rays, its noise, its z, its nulls."""

from dataclasses import replace

import numpy as np
import pytest
from shapely.geometry import LineString, Point, Polygon

from kurumaisu.bench.hidden import Ask, make, names_of
from kurumaisu.bench.hidden.generator import laws
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.bench.hidden.generator.rays import cast
from kurumaisu.bench.hidden.generator.rooms import corners, draw_room, edges, world_text
from kurumaisu.bench.hidden.generator.scanning import expected
from kurumaisu.bench.hidden.generator.tours import draw_tour
from kurumaisu.bench.hidden.laser.catalogue import LASER
from kurumaisu.bench.hidden.laser.signal import LaserScale
from kurumaisu.bench.hidden.laser.usual_effects import CLEAN, Backdrop
from kurumaisu.bench.hidden.tables import TABLES, write_case
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.world import load_world


def same(one, other):
    return all(
        np.array_equal(a.scan.values, b.scan.values, equal_nan=True) and np.array_equal(a.pose.values, b.pose.values)
        for a, b in zip(one.runs, other.runs, strict=True)
    )


def test_rays_against_shapely():
    rng = np.random.default_rng(1)
    room = draw_room(rng)
    sides = edges(corners(room))
    origins, angles = rng.uniform(-1, 1, (60, 2)), rng.uniform(-np.pi, np.pi, 60)
    hits = cast(origins, angles, sides)
    boxes = [Polygon(box.corners()) for box in room]
    for origin, angle, reach, cosine, edge in zip(origins, angles, hits.ranges, hits.cosine, hits.edge, strict=True):
        far = origin + 20 * np.array([np.cos(angle), np.sin(angle)])
        met = [LineString([origin, far]).intersection(box.exterior) for box in boxes]
        distance = min(Point(origin).distance(where) for where in met if not where.is_empty)
        assert reach == pytest.approx(distance, abs=1e-9)
        x0, y0, x1, y1 = sides[edge]
        along = np.array([x1 - x0, y1 - y0]) / np.hypot(x1 - x0, y1 - y0)
        sine = along @ [np.cos(angle), np.sin(angle)]
        assert cosine == pytest.approx(np.sqrt(1 - sine**2), abs=1e-9)


def test_the_world_file_holds_the_walls_of_the_room(tmp_path):
    room = draw_room(np.random.default_rng(2))
    path = tmp_path / "room.world"
    path.write_text(world_text("room", room))
    ours = {tuple(np.round(corner, 6)) for corner in corners(room).reshape(-1, 2)}
    theirs = {tuple(np.round(corner, 6)) for corner in load_world(path).segments[:, :4].reshape(-1, 2)}
    assert ours == theirs


def test_a_seed_says_all_and_the_null_is_the_twin(tmp_path):
    ask = Ask("single", ("laser.offset",), regime="clean", design="room", z=30.0)
    first, again = make(ask, 3, tmp_path), make(ask, 3, tmp_path)
    assert same(first.recording, again.recording)
    other = make(replace(ask, ids=("laser.tilt",)), 3, tmp_path)
    assert same(first.null, other.null)
    offset = first.truth.parameters["laser.offset"]["offset"]
    change = np.concatenate(
        [a.scan.values - b.scan.values for a, b in zip(first.recording.runs, first.null.runs, strict=True)]
    )
    assert np.nanmean(change[np.isfinite(change)]) == pytest.approx(offset, abs=2e-5)


def null_errors(backdrop):
    """Readings of a null less the means at the true poses, over their deviations, and which there are."""
    tour = draw_tour("room", USUAL, np.random.default_rng(5))
    scans = expected(tour, ())
    unit = backdrop.noise(scans.sd, np.random.default_rng(6))
    return unit, scans


def test_a_clean_backdrop_is_equation_4():
    unit, scans = null_errors(CLEAN)
    assert unit.std() == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(laws.laser_mean(np.array([1.0])), 1.063413)
    np.testing.assert_allclose(laws.laser_sd(np.array([0.0, 2.0])), [0.002334, 0.002154])
    assert np.all(np.isfinite(scans.mean))


def test_a_backdrop_has_the_correlations_that_were_asked_for():
    unit, _ = null_errors(Backdrop(beam_rho=0.5))
    assert (unit[:, 1:] * unit[:, :-1]).mean() == pytest.approx(0.5, abs=0.02)
    assert (unit[:, 2:] * unit[:, :-2]).mean() == pytest.approx(0.25, abs=0.02)
    unit, scans = null_errors(Backdrop(common_sd=0.001, common_rho=0.9))
    scan_means = (unit * scans.sd).mean(axis=1)
    assert np.std(scan_means) == pytest.approx(0.001, rel=0.4)
    assert np.corrcoef(scan_means[1:], scan_means[:-1])[0, 1] == pytest.approx(0.9, abs=0.12)
    unit, scans = null_errors(Backdrop(beam_sd=0.001))
    assert (unit * scans.sd).mean(axis=0).std() == pytest.approx(0.001, rel=0.15)


def test_z_is_that_of_a_dense_covariance():
    """One stop, few beams: pose errors, common mode and correlated neighbours as one dense matrix of all scans."""
    backdrop = Backdrop(beam_rho=0.4, common_sd=0.001, common_rho=0.7)
    tour = draw_tour("wall", replace(USUAL, position_sd=0.003, heading_sd=0.004), np.random.default_rng(7))
    scale = LaserScale(tour, backdrop)
    pick = slice(0, 3)
    keep = np.flatnonzero(scale._seen[0])[::8]
    part = {name: getattr(scale.nominal, name)[pick][:, keep] for name in ("ranges", "cosine", "mean", "sd", "angles")}
    part |= {name: getattr(scale.nominal, name)[pick] for name in ("stop", "headings", "stamps", "leg")}
    scale.nominal = replace(
        scale.nominal, normal=scale.nominal.normal[pick][:, keep], box=scale.nominal.box[pick][:, keep], **part
    )
    scale._seen = scale._seen[pick][:, keep]
    assert scale.count == 5
    looked = 0.004 * part["ranges"]
    signal = np.repeat(looked, 5, axis=0)
    scans, beams = signal.shape
    sd = np.hypot(np.repeat(part["sd"], 5, axis=0), 0.001 / np.sqrt(12))
    neighbours = np.kron(np.eye(scans), 0.4 ** np.abs(np.subtract.outer(np.arange(beams), np.arange(beams))))
    covariance = np.diag(sd.ravel()) @ neighbours @ np.diag(sd.ravel())
    common = 0.001**2 * 0.7 ** np.abs(np.subtract.outer(np.arange(scans), np.arange(scans)))
    covariance += np.kron(common, np.ones((beams, beams)))
    pose = np.repeat(scale._pose_columns()[..., :3], 5, axis=0).reshape(-1, 3)
    covariance += pose @ np.diag([0.003**2, 0.003**2, 0.004**2]) @ pose.T
    z = np.sqrt(signal.ravel() @ np.linalg.solve(covariance, signal.ravel()))
    assert np.sqrt(scale.gram(looked[..., None])[0, 0]) == pytest.approx(z, rel=1e-3)


def test_a_tour_on_which_the_largest_size_hardly_shows_is_drawn_again(tmp_path):
    """On the first wall of this seed, one that is off by the most there is has z 3."""
    assert make(Ask("confounded", ("world.map_error",)), 50352, tmp_path).truth.z >= 5


def test_an_offset_is_no_sum_of_warm_ups(tmp_path):
    """In ten minutes each of them dies away, though a sum of three hardly does."""
    truth = make(Ask("single", ("laser.offset",), z=70.0, regime="clean", design="room"), 12, tmp_path).truth
    assert "laser.warmup" not in truth.near


def test_what_a_pose_error_does_is_its_derivative():
    tour = draw_tour("room", USUAL, np.random.default_rng(8))
    scale = LaserScale(tour, CLEAN)
    columns = scale._pose_columns()
    for axis, step in enumerate([1e-6, 1e-6, 1e-6]):
        moved = [replace(leg, path=leg.path + step * np.eye(3)[axis]) for leg in tour.legs]
        changed = LaserScale(replace(tour, legs=tuple(moved)), CLEAN).nominal
        seen = scale._seen & (changed.box == scale.nominal.box)
        np.testing.assert_allclose(
            (changed.ranges - scale.nominal.ranges)[seen] / step, columns[..., axis][seen], atol=0.01
        )


@pytest.mark.parametrize("name", [name for name in LASER if not LASER[name].moving])
def test_every_laser_id_can_be_hidden(name, tmp_path):
    z = 25.0 if LASER[name].by == "mean" else None
    case = make(Ask("single", (name,), z=z, regime="clean", design="room"), 12, tmp_path)
    assert case.truth.ids == (name,)
    assert not same(case.recording, case.null)
    if z:
        assert case.truth.z == pytest.approx(z, rel=0.1)
    assert case.truth.z > 5
    assert case.recording.world.is_file()


def test_late_stamps_show_in_a_drive(tmp_path):
    case = make(Ask("single", ("laser.latency",), z=25.0, regime="clean"), 12, tmp_path)
    assert not same(case.recording, case.null)
    assert case.truth.z == pytest.approx(25.0, rel=0.1)


@pytest.mark.parametrize("name", names_of("unknown", "laser"))
def test_strange_readings_are_left_by_the_whole_catalogue(name, tmp_path):
    truth = make(Ask("unknown", (name,), z=40.0, regime="clean"), 13, tmp_path).truth
    assert truth.z >= 39.9
    assert truth.z_rival >= truth.z * 0.999


@pytest.mark.parametrize("name", names_of("wrong", "laser"))
def test_wrong_scans_differ_from_their_null(name, tmp_path):
    case = make(Ask("wrong", (name,), regime="clean", design="room"), 14, tmp_path)
    assert not same(case.recording, case.null) or case.recording.world != case.null.world


def test_a_case_is_read_back_as_it_was_written(tmp_path):
    case = make(Ask("null", family="laser", regime="clean", design="room"), 15, tmp_path)
    write_case(tmp_path / "case", case.recording, case.truth)
    again = read_recording(tmp_path / "case")
    assert same(again, case.recording)
    assert again.laser == case.recording.laser
    assert again.truth == pytest.approx(case.recording.truth)
    assert again.world.read_text() == case.recording.world.read_text()


@pytest.mark.parametrize("damage", TABLES)
def test_damaged_tables_are_not_what_they_were(damage, tmp_path):
    case = make(Ask("null", regime="usual"), 16)
    write_case(tmp_path / "case", case.recording, damage=damage)
    t = np.loadtxt(tmp_path / "case/run_1/pose.csv", delimiter=",", skiprows=1)[:, 0]
    assert np.any(np.diff(t) <= 0)


def test_an_offset_is_no_twin_of_a_temperature_that_has_the_offset_in_it(tmp_path):
    case = make(Ask("single", ("laser.offset",), 30.0, regime="clean", design="room", family="laser"), 5, tmp_path)
    assert case.truth.z_rival > 0.1
    assert ("laser.temperature",) not in case.truth.accepted


def test_beside_noise_a_change_of_the_mean_is_worth_less(tmp_path):
    ids = ("laser.scale", "laser.range_noise")
    asked = {"regime": "clean", "design": "room", "family": "laser"}
    alone = make(Ask("single", ids[:1], 30.0, **asked), 5, tmp_path).truth.z_alone["laser.scale"]
    truth = make(Ask("pair", ids, 30.0, **asked), 5, tmp_path).truth
    share = truth.parameters["laser.range_noise"]["share"]
    assert 0.2 * alone < truth.z_alone["laser.scale"] < alone / (1 + 0.5 * share)


def test_a_truth_is_told_only_of_what_a_catalogue_has_a_word_for(tmp_path):
    """Of a contaminated normal there is no t, of a footprint's width no gain; offsets of beams have no mirror."""
    for name, plain, other in (
        ("laser.heavy_tails", {"inverse_nu"}, set()),
        ("laser.incidence_noise", {"gain"}, set()),
        ("laser.beam_bias", {"amplitude"}, {"sd"}),
        ("laser.range_noise", {"share"}, {"share"}),
    ):
        told = [set(LASER[name].called({"size": 0.1, "seed": 1.0}, form)) for form in ("plain", "other")]
        assert told == [plain, other]
    found = make(Ask("single", ("laser.mixed_pixels",), family="laser", form="plain", design="room"), 3, tmp_path)
    values = found.null.runs[0].scan.values
    seen = np.where(np.isfinite(values), values, np.nan)  # nothing is mixed with no return
    beside = np.abs(np.diff(seen, axis=1)) > 0.3
    mixed = (found.recording.runs[0].scan.values != values)[:, 1:-1]
    share = mixed[beside[:, 1:] | beside[:, :-1]].mean()
    assert share == pytest.approx(found.truth.parameters["laser.mixed_pixels"]["probability"], rel=0.2)
