"""Rays against pyproj, radii and lever arms against pymap3d, and attitude against a product of rotation matrices."""

import numpy as np
import pymap3d
import pytest
from numpy.typing import NDArray
from pyproj import Geod, Transformer
from scipy.spatial.transform import Rotation

from monitor.geodesy import (
    HIGHEST_LATITUDE_DEG,
    LONGEST_RANGE_NM,
    SEMI_MAJOR_M,
    along,
    body_to_enu,
    curvature_radii,
    displace,
    ray,
)

SEMI_MINOR_M = 6356752.314245179
AZIMUTHS = range(0, 360, 5)


@pytest.mark.parametrize(("range_nm", "share_of_a_bin"), [(5, 0.001), (10, 0.001), (20, 0.002), (40, 0.01), (80, 0.05)])
@pytest.mark.parametrize("latitude_deg", [-70, -45, -10, 0, 20, 45, 60, 70])
def test_a_ray_follows_the_geodesic_well_within_a_tenth_of_a_range_bin(
    latitude_deg: int, range_nm: int, share_of_a_bin: float
) -> None:
    """The cubic's remainder grows with the fourth power of the distance, a bin only with the first."""
    assert range_nm <= LONGEST_RANGE_NM
    assert abs(latitude_deg) <= HIGHEST_LATITUDE_DEG
    geod = Geod(ellps="WGS84")
    reach_m = range_nm * 1852.0
    for azimuth in AZIMUTHS:
        for s in (reach_m / 3, reach_m):
            lat, lon = along(ray(latitude_deg, -71.0, 0.0, np.radians(azimuth)), s)
            true_lon, true_lat, _ = geod.fwd(-71.0, latitude_deg, azimuth, s)
            assert geod.inv(lon, lat, true_lon, true_lat)[2] < share_of_a_bin * reach_m / 512


def test_a_ray_goes_on_across_the_date_line() -> None:
    """Longitudes beyond 180 degrees are those of the terrain's columns there."""
    for azimuth in AZIMUTHS:
        lat, lon = along(ray(-17.0, 179.95, 0.0, np.radians(azimuth)), 18_520.0)
        assert abs(lon - 179.95) < 0.18
        true_lon, true_lat, _ = Geod(ellps="WGS84").fwd(179.95, -17.0, azimuth, 18_520.0)
        assert Geod(ellps="WGS84").inv(lon, lat, true_lon, true_lat)[2] < 0.01


@pytest.mark.parametrize("azimuth", AZIMUTHS[::3])
def test_distances_at_height_are_measured_at_that_height(azimuth: int) -> None:
    """At 9000 m a horizontal 20 NM spans 52 m less of the ellipsoid: the same geodesic on an ellipsoid as much larger.

    The two surfaces differ by the ellipticity times h / a: 20 NM x 0.0067 x 0.0014 is 0.35 m.
    """
    raised = Geod(a=SEMI_MAJOR_M + 9000, b=SEMI_MINOR_M + 9000)
    lat, lon = along(ray(44.0, -71.0, 9000.0, np.radians(azimuth)), 20 * 1852.0)
    true_lon, true_lat, _ = raised.fwd(-71.0, 44.0, azimuth, 20 * 1852.0)
    assert raised.inv(lon, lat, true_lon, true_lat)[2] < 0.4


@pytest.mark.parametrize("latitude_deg", [-70, -30, 0, 45, 70])
def test_the_radii_of_curvature_are_those_of_pymap3d(latitude_deg: int) -> None:
    meridian, prime = curvature_radii(np.radians(latitude_deg))
    assert meridian == pytest.approx(pymap3d.rcurve.meridian(latitude_deg), rel=1e-12)
    assert prime == pytest.approx(pymap3d.rcurve.transverse(latitude_deg), rel=1e-12)


def enu(body: tuple[float, float, float], roll: float, pitch: float, heading: float) -> list[float]:
    forward, right, down = (np.array([x]) for x in body)
    vectors = body_to_enu(forward, right, down, np.array([roll]), np.array([pitch]), np.array([heading]))
    return [round(float(v[0]), 9) + 0.0 for v in vectors]


def test_the_attitude_equals_a_product_of_rotation_matrices() -> None:
    """North, east, down from body is Rz(heading) Ry(pitch) Rx(roll), axes forward, right, down."""
    rng = np.random.default_rng(5)
    forward, right, down = body = rng.normal(size=(3, 200))
    heading, pitch, roll = rng.uniform(-180, 180, 200), rng.uniform(-90, 90, 200), rng.uniform(-180, 180, 200)
    ned = Rotation.from_euler("ZYX", np.c_[heading, pitch, roll], degrees=True).apply(body.T)
    found = np.stack(body_to_enu(forward, right, down, roll, pitch, heading))
    np.testing.assert_allclose(found, [ned[:, 1], ned[:, 0], -ned[:, 2]], atol=1e-14)


def test_heading_turns_the_nose_clockwise_from_north() -> None:
    assert enu((1, 0, 0), 0, 0, 0) == [0, 1, 0]
    assert enu((1, 0, 0), 0, 0, 90) == [1, 0, 0]
    assert enu((0, 1, 0), 0, 0, 90) == [0, -1, 0]


def test_pitch_raises_the_nose_and_roll_lowers_the_right_wing() -> None:
    assert enu((1, 0, 0), 0, 30, 0)[2] == 0.5
    assert enu((0, 1, 0), 30, 0, 0)[2] == -0.5
    assert enu((0, -1, 0), 30, 0, 0)[2] == 0.5


def test_a_lever_arm_moves_the_position_as_pyproj_says() -> None:
    moved: list[NDArray[np.float64]] = list(displace(*(np.array([x]) for x in (44.4, -71.7, 761.0, 12.0, -30.0, -2.5))))
    to_enu = Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84"
        " +step +proj=topocentric +ellps=WGS84 +lat_0=44.4 +lon_0=-71.7 +h_0=761"
    )
    found = to_enu.transform(moved[1], moved[0], moved[2])
    np.testing.assert_allclose(np.ravel(found), [12.0, -30.0, -2.5], atol=1e-6)


def test_a_lever_arm_of_any_direction_moves_a_position_anywhere_to_a_tenth_of_a_millimetre() -> None:
    random = np.random.default_rng(1)
    latitude, longitude = random.uniform(-90, 90, 2000), random.uniform(-180, 180, 2000)
    height_m, arm = random.uniform(-500, 15_000, 2000), random.uniform(-100, 100, (3, 2000))
    found = np.array(displace(latitude, longitude, height_m, *arm))
    right = np.array(pymap3d.enu2geodetic(*arm, latitude, longitude, height_m))
    assert np.abs(found[:2] - right[:2]).max() < 1e-9
    assert np.abs(found[2] - right[2]).max() < 1e-4
