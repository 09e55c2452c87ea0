"""The resampled ground against the file's own bytes, a plane, and geodesics."""

from pathlib import Path

import numpy as np
import pyproj
import pytest
import rasterio
from affine import Affine
from numpy.typing import NDArray

from simulators.scenario import BUILT_IN_TERRAIN, World
from simulators.terrain import build

HERE = (np.array([44.3]), np.array([-71.5]))


@pytest.fixture
def plane(tmp_path: Path) -> Path:
    """About 45 N 7 E, posts 2 arc-seconds apart, rising 100 m an arc-minute north and 50 m east, with a void."""
    step, size = 2 / 3600, 720
    column, row = np.meshgrid(np.arange(size), np.arange(size))
    heights = (1000 + (step * (size / 2 - row)) * 6000 + (step * (column - size / 2)) * 3000).astype(np.float32)
    heights[100, 100] = -9999
    path = tmp_path / "plane.tif"
    corner = Affine(step, 0, 7 - step * (size + 1) / 2, 0, -step, 45 + step * (size + 1) / 2)
    with rasterio.open(
        path, "w", driver="GTiff", width=size, height=size, count=1, dtype="float32", crs="EPSG:4326",
        transform=corner, nodata=-9999,
    ) as file:  # fmt: skip
        file.write(heights, 1)
    return path


def posts_of_the_built_in_cell() -> NDArray[np.int64]:
    raw = np.frombuffer(BUILT_IN_TERRAIN["white_mountains"].read_bytes(), ">i2")
    return raw.reshape(1201, 1201).astype(np.int64)


def test_without_noise_the_ground_passes_through_the_posts_of_the_file() -> None:
    ground = build(World(post_noise_m=0.0, spacing_m=15.0), *HERE, 6000.0, seed=0)
    row, column = np.meshgrid(np.arange(820, 860), np.arange(580, 620))
    east, north = ground.locate(45 - row / 1200, -72 + column / 1200)
    error = ground.elevation(east, north) - posts_of_the_built_in_cell()[row, column]
    assert np.std(error) < 1.0
    assert np.max(np.abs(error)) < 8.0


def test_post_noise_has_its_standard_deviation_and_comes_from_the_seed() -> None:
    quiet = build(World(post_noise_m=0.0), *HERE, 6000.0, seed=0).heights
    noisy, again, other = (build(World(post_noise_m=3.0), *HERE, 6000.0, seed=seed).heights for seed in (1, 1, 2))
    assert np.std(noisy - quiet) == pytest.approx(2.7, abs=0.5)  # a little less than 3 between the posts
    assert np.array_equal(noisy, again)
    assert not np.array_equal(noisy, other)


def test_a_plane_in_latitude_and_longitude_is_read_to_a_decimetre(plane: Path) -> None:
    ground = build(World(terrain=str(plane), post_noise_m=0.0), np.array([45.0]), np.array([7.0]), 5000.0, seed=0)
    latitude, longitude = np.array([45.01, 44.97]), np.array([7.02, 6.96])
    expected = 1000 + (latitude - 45) * 6000 + (longitude - 7) * 3000
    assert ground.elevation(*ground.locate(latitude, longitude)) == pytest.approx(expected, abs=0.1)


def test_heights_are_what_scale_and_offset_of_the_file_make_of_its_numbers(plane: Path) -> None:
    track = (np.array([45.0]), np.array([7.0]))
    plain = build(World(terrain=str(plane), post_noise_m=0.0), *track, 5000.0, seed=0)
    with rasterio.open(plane, "r+") as file:
        file.scales, file.offsets = (0.5,), (50.0,)
    scaled = build(World(terrain=str(plane), post_noise_m=0.0), *track, 5000.0, seed=0)
    np.testing.assert_allclose(scaled.heights, plain.heights / 2 + 50, atol=1e-3)


@pytest.mark.parametrize("file_turns", [0, -1])
@pytest.mark.parametrize("flight_turns", [0, -1])
def test_the_date_line_is_a_meridian_like_any_other(
    plane: Path, tmp_path: Path, file_turns: int, flight_turns: int
) -> None:
    """The plane moved from 7 to 180 degrees east, where files and flights count on or begin at -180."""
    with rasterio.open(plane) as file:
        profile, posts = file.profile, file.read()
    profile["transform"] = Affine.translation(173 + 360 * file_turns, 0) @ profile["transform"]
    path = tmp_path / "line.tif"
    with rasterio.open(path, "w", **profile) as file:
        file.write(posts)
    track = np.array([45.0, 45.0]), np.array([6.99, 7.02])
    inland = build(World(terrain=str(plane)), *track, 5000.0, seed=0)
    ground = build(World(terrain=str(path)), track[0], track[1] + 173 + 360 * flight_turns, 5000.0, seed=0)
    np.testing.assert_allclose(ground.heights, inland.heights, atol=1e-3)


def test_ground_that_the_file_lacks_is_refused_with_its_place_unless_allowed(plane: Path) -> None:
    track = (np.array([45.0]), np.array([7.0]))
    with pytest.raises(ValueError, match=r"plane.tif holds no ground at .* world.incomplete"):
        build(World(terrain=str(plane)), *track, 25_000.0, seed=0)
    ground = build(World(terrain=str(plane), incomplete=True), *track, 25_000.0, seed=0)
    assert np.isnan(ground.elevation([24_000.0, 30_000.0], [0.0, 0.0])).all()
    assert np.isfinite(ground.elevation([0.0], [0.0])).all()


def test_a_single_void_post_leaves_only_its_surroundings_unknown(plane: Path) -> None:
    void = (np.array([45 + 260 * 2 / 3600]), np.array([7 - 260 * 2 / 3600]))
    with pytest.raises(ValueError, match="holds no ground"):
        build(World(terrain=str(plane)), *void, 1000.0, seed=0)
    ground = build(World(terrain=str(plane), incomplete=True), *void, 1000.0, seed=0)
    unknown = np.isnan(ground.heights).sum() * ground.spacing**2
    assert 0 < unknown < 4 * 62 * 44 * 2


def test_a_missing_file_is_named_with_what_is_built_in() -> None:
    with pytest.raises(FileNotFoundError, match=r"nowhere.tif.*white_mountains"):
        build(World(terrain="nowhere.tif"), *HERE, 1000.0, seed=0)


@pytest.mark.parametrize("azimuth_deg", [0.0, 45.0, 197.6, 270.0])
def test_a_true_azimuth_twenty_kilometres_from_the_centre_becomes_the_geodesics_bearing(azimuth_deg: float) -> None:
    ground = build(World(incomplete=True), np.array([44.2, 44.8]), np.array([-71.7, -71.3]), 1000.0, seed=0)
    longitude, latitude = -71.25, 44.5
    far_longitude, far_latitude, _ = pyproj.Geod(ellps="WGS84").fwd(longitude, latitude, azimuth_deg, 1000.0)
    (east, far_east), (north, far_north) = ground.locate([latitude, far_latitude], [longitude, far_longitude])
    bearing = np.degrees(np.arctan2(far_east - east, far_north - north))
    found = ground.grid_bearing([latitude], [longitude], [azimuth_deg])[0]
    assert (found - bearing + 180) % 360 - 180 == pytest.approx(0, abs=2e-3)
    assert abs((bearing - azimuth_deg + 180) % 360 - 180) > 0.1
