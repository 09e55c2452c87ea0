"""CfRadial files as xradar and Py-ART read and georeference them, and as the standard's equations have them."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from decoders.arinc708 import unpack
from decoders.profiles import load_profile
from gateway.exports.pointing import look
from monitor.geodesy import NM_M, along, ray
from monitor.scans import Scan
from monitor.shade import radar_states
from simulators.flight import Trajectory
from tests.gateway.exports.recorded import UTC_NS, Flown, To, record
from tests.gateway.live import replayed
from tests.gateway.made import RACK, Bridge, raw, sweep

# Py-ART's reader tells everyone to use xradar instead, and still is what its users have; its plots ask Cartopy for
# names that Cartopy has given up.
DEPRECATED = pytest.mark.filterwarnings("ignore:Py-ART's CfRadial module is deprecated:UserWarning:pyart.io.cfradial")
PLOTS = pytest.mark.filterwarnings(
    r"ignore:The \w+_FORMATTER module-level attribute was deprecated:DeprecationWarning:pyart.graph.max_cappi"
)
FLATTENING = 1 / 298.257
SMALLEST_EARTH_M = 6_335_000.0  # radius of curvature


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    with netCDF4.Dataset(path) as file:
        yield file


@pytest.fixture
def scans(flown: Flown, to: To) -> list[Path]:
    path, said = to(flown.path, "cfradial")
    found = sorted(path.iterdir())
    assert said == [f"{path}: {len(found)} scans, a file each"]
    return found


def gates(file: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Latitude and longitude of each gate by our own geodesy: straight beams from the file's one position."""
    latitude, longitude, height = (float(file[name][...]) for name in ("latitude", "longitude", "altitude"))
    out = np.empty((2, len(file["azimuth"]), len(file["range"])))
    for k, (azimuth, elevation) in enumerate(zip(*np.radians((file["azimuth"][:], file["elevation"][:])), strict=True)):
        for j, slant in enumerate(file["range"][:].astype(float).tolist()):
            line = ray(latitude, longitude, height + slant * np.sin(elevation), azimuth)  # where its end lies
            out[:, k, j] = along(line, slant * np.cos(elevation))
    return out[0], out[1]


def apart_m(latitude: NDArray[np.float64], longitude: NDArray[np.float64], file: Any) -> NDArray[np.float64]:
    """How far positions of gates lie from ours, metres on the ellipsoid."""
    ours = gates(file)
    north = np.radians(latitude - ours[0]) * 6_367_000
    east = np.radians(longitude - ours[1]) * 6_389_000 * np.cos(np.radians(ours[0]))
    return np.asarray(np.hypot(north, east))


def test_xradar_puts_every_gate_where_our_geodesy_does(scans: list[Path]) -> None:
    """Its earth has 4/3 of the radius, so that it takes a quarter less of what the height does to an arc."""
    import xradar

    tree = xradar.io.open_cfradial1_datatree(scans[0])
    sweep_0 = tree["sweep_0"].to_dataset(inherit="all_coords")
    placed = xradar.georeference.get_x_y_z(sweep_0, target_crs=4326)
    with opened(scans[0]) as file:
        order = np.argsort(file["azimuth"][:])  # as xradar sorts
        back = np.argsort(order)
        found = apart_m(placed["y"].values[back], placed["x"].values[back], file)
        ranges = file["range"][:].astype(float)
        assert (found <= ranges * float(file["altitude"][...]) / SMALLEST_EARTH_M / 4).all()
        levels = sweep_0["radar_level"].values
        assert np.array_equal(levels, file["radar_level"][:][order])
    assert tree["primary_axis"].item().decode() == "axis_z"


@DEPRECATED
@PLOTS
def test_py_art_puts_every_gate_where_our_geodesy_does(scans: list[Path]) -> None:
    """Its map is of a sphere, and so off by up to the flattening of the ellipsoid, a 298th of the range."""
    import pyart

    radar = pyart.io.read_cfradial(scans[0])
    with opened(scans[0]) as file:
        found = apart_m(radar.gate_latitude["data"], radar.gate_longitude["data"], file)
        assert (found <= radar.range["data"] * FLATTENING + 0.01).all()
        assert np.array_equal(radar.fields["radar_level"]["data"], file["radar_level"][:])
    assert (radar.nsweeps, radar.scan_type, radar.metadata["platform_is_mobile"]) == (1, "sector", "true")
    assert radar.metadata["shadebus_verdict"] == "ok"
    assert radar.rotation["data"].shape == radar.tilt["data"].shape == radar.heading["data"].shape == (radar.nrays,)


def standard_angles(roll: Any, pitch: Any, heading: Any, rotation: Any, tilt: Any) -> tuple[Any, Any]:
    """Azimuth and elevation by CfRadial 1.4, section 7, axis z: rotation from ahead to the right, tilt up.

    SciPy's rotations are of north, east, down: heading, then pitch, then roll; pymap3d reads the direction.
    """
    turned, raised = np.radians(rotation), np.radians(tilt)
    body = np.stack([np.cos(raised) * np.cos(turned), np.cos(raised) * np.sin(turned), -np.sin(raised)], axis=-1)
    north, east, down = (
        Rotation.from_euler("ZYX", np.stack([heading, pitch, roll], axis=-1), degrees=True).apply(body).T
    )
    far_m = 1e7  # as pymap3d takes a millimetre for nothing
    azimuth, elevation, _ = pymap3d.enu2aer(far_m * east, far_m * north, -far_m * down)
    return azimuth, elevation


def test_azimuth_and_elevation_follow_from_rotation_and_tilt_by_the_standard(scans: list[Path]) -> None:
    for path in scans:
        with opened(path) as file:
            names = ("roll", "pitch", "heading", "rotation", "tilt", "azimuth", "elevation")
            columns = np.ma.stack([file[name][:] for name in names])
            known = columns[:, ~columns.mask.any(axis=0)].data
            assert known.shape[1] > 10
            azimuth, elevation = standard_angles(*known[:5])
            assert np.abs((azimuth - known[5] + 180) % 360 - 180).max() < 1e-9
            assert np.abs(elevation - known[6]).max() < 1e-9
            assert np.abs(known[4] - known[6]).max() > 0.01  # the aircraft rolls and pitches, so this was a test


ANGLES = st.tuples(*(st.floats(*limits) for limits in ((-60, 60), (-30, 30), (0, 360), (-90, 90), (-15, 15))))


@given(st.lists(ANGLES, min_size=1, max_size=4), st.booleans())
def test_a_beam_points_by_the_standard_whether_it_is_stabilised_or_not(
    angles: list[tuple[float, ...]], stabilised: bool
) -> None:
    roll, pitch, heading, scan_angle, tilt = np.array(angles).T
    n = len(angles)
    scan = Scan(
        0, np.zeros(n, np.int64), scan_angle, np.zeros(n, np.bool_), np.zeros((n, 1), np.uint8), tilt[0], 10.0, 2,
        stabilised, 0, 0, 0,
    )  # fmt: skip
    beam = look(scan, {"roll": roll, "pitch": pitch, "heading": heading})
    azimuth, elevation = standard_angles(roll, pitch, heading, beam.rotation_deg, beam.tilt_deg)
    assert np.abs((azimuth - beam.azimuth_deg + 180) % 360 - 180).max() < 1e-6
    assert np.abs(elevation - beam.elevation_deg).max() < 1e-6
    if stabilised:
        assert np.allclose(beam.elevation_deg, tilt[0])
        assert np.abs((beam.azimuth_deg - heading - scan_angle + 180) % 360 - 180).max() < 1e-9
    else:
        assert np.allclose(beam.tilt_deg, tilt[0])
        assert np.allclose((beam.rotation_deg - scan_angle + 180) % 360, 180)


def test_positions_and_attitude_are_those_that_were_flown(flown: Flown, scans: list[Path]) -> None:
    """Against the simulated truth, within six standard deviations of the instruments' stated errors."""
    errors = flown.scenario.errors
    trajectory = Trajectory(flown.scenario.flight, flown.scenario.seed)
    with opened(scans[1]) as file:
        start = np.datetime64(netCDF4.chartostring(file["time_coverage_start"][:]).item()[:-1], "ns").astype(np.int64)
        utc_ns = start + file["time"][:] * 1e9
        truth = trajectory.at((utc_ns - UTC_NS) / 1e9)
        assert np.abs(file["platform_latitude"][:] - truth.latitude_deg).max() < 6 * errors.gnss_position_deg
        assert np.abs(file["platform_altitude"][:] - truth.height_m).max() < 6 * errors.gnss_altitude_m
        assert np.abs(file["heading"][:] - truth.heading_deg).max() < 6 * errors.inertial_angle_deg + 0.05
        assert np.abs(file["roll"][:] - truth.roll_deg).max() < 6 * errors.inertial_angle_deg + 0.05
        middle = len(utc_ns) // 2
        assert float(file["latitude"][...]) == file["platform_latitude"][middle]
        assert float(file["longitude"][...]) == file["platform_longitude"][middle]


def test_levels_ranges_and_threads_are_those_of_the_radials(flown: Flown, scans: list[Path]) -> None:
    words = np.array([np.frombuffer(one.word, np.uint8) for one in flown.radar if isinstance(one.word, bytes)])
    radials = unpack(words)
    levels = []
    for path in scans:
        with opened(path) as file:
            levels.append(file["radar_level"][:])
            assert file["radar_level"].flag_meanings.split() == [*load_profile("arinc708").level_names]
            assert file["radar_level"].flag_values.tolist() == [*range(8)]
            width_m = 10 * NM_M / 512
            assert np.allclose(file["range"][:], (np.arange(512) + 0.5) * width_m, rtol=1e-6)
            seen = file["radar_shadow"][:]
            compared = np.asarray(~np.ma.getmaskarray(seen).any(axis=1))
            assert np.array_equal(seen[compared], radar_states(levels[-1].data[compared]))
            terrain = file["terrain_shadow"][:]
            assert np.array_equal(np.ma.getmaskarray(terrain).any(axis=1), ~compared)
            assert set(np.unique(terrain.compressed()).tolist()) <= {-3, 0, 1, 2}
            assert compared.sum() >= len(compared) - 2  # the first ray comes before the first position
    assert np.array_equal(np.concatenate(levels), radials.bins)


def test_the_verdict_stands_in_the_attributes(flown: Flown, scans: list[Path]) -> None:
    verdicts = [event for event in map(json.loads, replayed(flown.path)) if event["type"] == "integrity"]
    assert len(scans) == len(verdicts) == 3
    for path, verdict in zip(scans, verdicts, strict=True):
        with opened(path) as file:
            said = {
                name: getattr(file, f"shadebus_{name}", None) for name in ("scan", "verdict", "n_pairs", "q", "p_fa")
            }
            assert said == {name: verdict[name] for name in said}
            assert file.shadebus_reasons == "; ".join(verdict["reasons"])


def test_what_is_not_known_is_missing_and_never_zero(tmp_path: Path, to: To) -> None:
    """A radar alone: no position, no attitude, no terrain."""
    bridge = Bridge()
    path, _ = to(record(tmp_path / "r.mcap", RACK, [raw(0, 2.0, bridge.hello() + sweep(bridge, 0.5))]), "cfradial")
    first, _ = sorted(path.iterdir())
    with opened(first) as file:
        for name in (
            "latitude",
            "longitude",
            "altitude",
            "azimuth",
            "heading",
            "rotation",
            "platform_latitude",
            "drift",
        ):
            assert np.ma.getmaskarray(file[name][...]).all(), name
        for name in ("radar_shadow", "terrain_shadow"):
            assert np.ma.getmaskarray(file[name][:]).all()
        assert file["elevation"][:].tolist() == [-2.0] * 10  # a stabilised antenna needs no attitude
        assert file["scan_angle"][:].tolist() == pytest.approx([*range(-15, 15, 3)], abs=0.05)
        assert (file.shadebus_verdict, file.shadebus_reasons.split(";")[0]) == (
            "unavailable",
            "no terrain to compare with",
        )
        assert not hasattr(file, "shadebus_q")
        assert file["radar_level"][:].mask.sum() == 0
