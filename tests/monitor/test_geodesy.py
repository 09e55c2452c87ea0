"""Rays, radii and lever arms against pyproj and pymap3d, and attitude against a product of rotation matrices."""

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from pymap3d.vincenty import vreckon
from pyproj import Geod, Transformer
from scipy.spatial.transform import Rotation

from monitor.geodesy import (
    HIGHEST_LATITUDE_DEG,
    LONGEST_RANGE_NM,
    SEMI_MAJOR_M,
    Ray,
    along,
    bend,
    body_to_enu,
    curvature_radii,
    displace,
    ray,
)

SEMI_MINOR_M = 6356752.314245179
WGS84 = Geod(ellps="WGS84")
MILLIMETRE = 1e-3
AZIMUTHS = range(0, 360, 5)
FARTHEST_M = LONGEST_RANGE_NM * 1852.0


def path(r: Ray, s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Latitudes and longitudes (2, n) in degrees along a ray."""
    return np.array([along(r, distance) for distance in s.tolist()]).T


def reached(
    latitude: NDArray[np.float64], longitude: NDArray[np.float64], azimuth: NDArray[np.float64], s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Latitudes and longitudes (2, n) in degrees that rays on the ellipsoid lead to; all arguments (n,)."""
    every = zip(latitude, longitude, np.radians(azimuth), s, strict=True)
    return np.array([along(ray(lat, lon, 0.0, alpha), distance) for lat, lon, alpha, distance in every]).T


def apart_m(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Metres in space between places (2, n) in degrees on the ellipsoid."""
    ends = (np.array(pymap3d.geodetic2ecef(*place, np.zeros(place.shape[1]))) for place in (one, other))
    return np.asarray(np.linalg.norm(np.subtract(*ends), axis=0))


def drawn(seed: int, n: int) -> tuple[NDArray[np.float64], ...]:
    """Latitudes, longitudes, azimuths and distances (n,), every tenth at the highest latitude or the longest range."""
    random = np.random.default_rng(seed)
    latitude = random.uniform(-HIGHEST_LATITUDE_DEG, HIGHEST_LATITUDE_DEG, n)
    longitude, azimuth = random.uniform(-180, 180, n), random.uniform(0, 360, n)
    range_m = random.choice([1, 5, 10, 20, 40, LONGEST_RANGE_NM], n) * 1852.0
    s = random.uniform(0, range_m)
    latitude[::10] = np.copysign(HIGHEST_LATITUDE_DEG, latitude[::10])
    s[5::10] = range_m[5::10]
    s[::20] = FARTHEST_M
    return latitude, longitude, azimuth, s


def test_a_ray_leads_anywhere_within_its_limits_to_where_pyproj_and_pymap3d_do_to_a_millimetre() -> None:
    latitude, longitude, azimuth, s = drawn(1, 20_000)
    found = reached(latitude, longitude, azimuth, s)
    by_karney = np.array(WGS84.fwd(longitude, latitude, azimuth, s)[1::-1])
    assert apart_m(found, by_karney).max() < MILLIMETRE
    assert apart_m(found, np.array(vreckon(latitude, longitude, s, azimuth))).max() < MILLIMETRE


@pytest.mark.parametrize("latitude_deg", [-70, -45, -1, 0, 45, 60, 70])
def test_a_ray_keeps_to_the_millimetre_all_along_and_in_the_main_directions(latitude_deg: int) -> None:
    s = np.linspace(0, FARTHEST_M, 600)
    for azimuth in (*AZIMUTHS, 359.999):
        found = path(ray(latitude_deg, -71.0, 0.0, np.radians(azimuth)), s)
        longitude, latitude, azimuths = np.repeat([[-71.0], [latitude_deg], [azimuth]], s.size, axis=1)
        assert apart_m(found, np.array(WGS84.fwd(longitude, latitude, azimuths, s)[1::-1])).max() < MILLIMETRE


def test_a_ray_begins_exactly_at_its_place() -> None:
    for latitude, longitude, azimuth, _ in np.array(drawn(2, 200)).T:
        assert along(ray(latitude, longitude, 1000.0, np.radians(azimuth)), 0.0) == (latitude, longitude)


@pytest.mark.parametrize("longitude_deg", [179.95, -179.95])
@pytest.mark.parametrize("latitude_deg", [-70.0, -17.0, 52.0])
def test_a_ray_goes_on_across_the_date_line(latitude_deg: float, longitude_deg: float) -> None:
    """Longitudes beyond 180 degrees are those of the terrain's columns there."""
    s = np.linspace(0, FARTHEST_M, 50)
    crossed = 0
    for azimuth in AZIMUTHS:
        found = path(ray(latitude_deg, longitude_deg, 0.0, np.radians(azimuth)), s)
        longitude, latitude, azimuths = np.repeat([[longitude_deg], [latitude_deg], [azimuth]], s.size, axis=1)
        true_lon, true_lat, _ = WGS84.fwd(longitude, latitude, azimuths, s)
        unwrapped = longitude_deg + (true_lon - longitude_deg + 180) % 360 - 180
        np.testing.assert_allclose(found[1], unwrapped, rtol=0, atol=1e-7)
        assert apart_m(found, np.array([true_lat, true_lon])).max() < MILLIMETRE
        crossed += bool((np.abs(found[1]) > 180).any())
    assert crossed > 20


@pytest.mark.parametrize("azimuth", AZIMUTHS[::3])
def test_distances_at_height_are_measured_at_that_height(azimuth: int) -> None:
    """At 9000 m a horizontal 20 NM spans 52 m less of the ellipsoid: the same geodesic on an ellipsoid as much larger.

    The two surfaces differ by the flattening squared times h / a: 20 NM x 1.1e-5 x 0.0014 is 0.6 mm.
    """
    raised = Geod(a=SEMI_MAJOR_M + 9000, b=SEMI_MINOR_M + 9000)
    lat, lon = along(ray(44.0, -71.0, 9000.0, np.radians(azimuth)), 20 * 1852.0)
    true_lon, true_lat, _ = raised.fwd(-71.0, 44.0, azimuth, 20 * 1852.0)
    assert raised.inv(lon, lat, true_lon, true_lat)[2] < MILLIMETRE


@pytest.mark.parametrize("height_m", [-400.0, 0.0, 12_000.0])
def test_a_ray_at_any_height_is_as_long_as_it_says_and_turns_neither_left_nor_right(height_m: float) -> None:
    """In space, by pymap3d: what a geodesic is, on a surface that no library has."""
    steps = 600
    s = np.linspace(0, FARTHEST_M, steps + 1)
    for latitude, longitude, azimuth, _ in np.array(drawn(3, 60)).T:
        lat, lon = path(ray(latitude, longitude, height_m, np.radians(azimuth)), s)
        step = np.diff(pymap3d.geodetic2ecef(lat, lon, np.full(s.size, height_m)))
        length = np.linalg.norm(step, axis=0)
        assert abs(length.sum() - FARTHEST_M) < MILLIMETRE
        up = np.array(pymap3d.enu2uvw(0.0, 0.0, 1.0, lat[1:-1], lon[1:-1]))
        turns = (np.diff(step) * np.cross(step[:, 1:], up, axis=0)).sum(axis=0) / length[1:] ** 2
        east, north, _ = pymap3d.uvw2enu(*step[:, 0], latitude, longitude)
        first = np.arctan2(east, north) - np.radians(azimuth)
        headings = np.concatenate([[(first + np.pi) % (2 * np.pi) - np.pi], turns])
        assert np.abs(np.cumsum(length * np.cumsum(headings))).max() < MILLIMETRE


def polynomials(r: Ray) -> tuple[Polynomial, Polynomial]:
    return Polynomial(r[:6]), Polynomial(r[6:])


COEFFICIENTS = st.tuples(*[st.floats(-1, 1)] * 12)


@given(COEFFICIENTS, st.floats(1.0, FARTHEST_M))
def test_no_ray_bends_more_than_the_bound_says(coefficients: tuple[float, ...], far_m: float) -> None:
    r = Ray(*(c / far_m ** (k % 6) for k, c in enumerate(coefficients)))
    s = np.linspace(0, far_m, 500)
    for whole in polynomials(r):
        rates, tangent = whole.deriv()(s), whole.coef[0] + whole.coef[1] * s
        assert np.abs(rates - rates[0]).max() <= bend(r, far_m) * (1 + 1e-9)
        assert np.abs(whole(s) - tangent).max() <= far_m * bend(r, far_m) * (1 + 1e-9)


def test_the_bound_of_a_ray_is_no_more_than_thrice_what_it_bends() -> None:
    for latitude, longitude, azimuth, _ in np.array(drawn(4, 200)).T:
        r = ray(latitude, longitude, 0.0, np.radians(azimuth))
        s = np.linspace(0, FARTHEST_M, 500)
        bends = max(np.abs(whole.deriv()(s) - whole.coef[1]).max() for whole in polynomials(r))
        assert bend(r, FARTHEST_M) < 3 * bends


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
