"""The Monte Carlo of the terrain thread: errors as drawn, a triangle with an exact answer, and runs that repeat."""

import math

import numpy as np
import pytest

from decoders.definitions import load_definitions
from monitor.bus_steps import bus_steps
from monitor.monte_carlo import NO_STEPS, TABLE_4, Outcome, Setup, Variables, around, draw_errors, simulate
from monitor.prediction import Beam, Pointing, predict
from monitor.residuals import moments
from monitor.terrain import Terrain
from tests.monitor.ground import LATITUDE, LONGITUDE, mesa

BIN_M = 36.17
PENCIL = Beam(azimuth_fan=1, refraction_k=math.inf)
BUS = bus_steps(load_definitions("gnss_743a"), load_definitions("iru_704"))
MOUNTAINS = Setup(
    Variables(44.5, -71.5, 800.0), TABLE_4, BUS, 3.0, 256, 2 * BIN_M, Beam(), (3, 256), "overlap", seed=3, radials=60
)


def test_the_steps_are_those_of_the_words() -> None:
    """Fine position 180/2^31, height 0.125 ft, heading 180/2^15, attitude 180/2^14; ARINC 708: 360/4096 and 1/4."""
    assert BUS._asdict() == pytest.approx(
        {
            "latitude_deg": 180 / 2**31,
            "longitude_deg": 180 / 2**31,
            "height_m": 0.125 * 0.3048,
            "pitch_deg": 180 / 2**14,
            "roll_deg": 180 / 2**14,
            "heading_deg": 180 / 2**15,
            "azimuth_deg": 360 / 4096,
            "tilt_deg": 0.25,
        },
        rel=1e-12,
    )
    finer = bus_steps(load_definitions("gnss_743a"), load_definitions("iru_704_18bit"))
    assert (finer.pitch_deg, finer.heading_deg) == (180 / 2**18, 180 / 2**18)


def test_errors_scatter_as_sensor_and_bus_together() -> None:
    """The variance of an error and of a uniform one over a step: a tilt of 0.01 in steps of 0.25 degrees, 0.073."""
    rng = np.random.default_rng(1)
    drawn = [draw_errors(rng, MOUNTAINS) for _ in range(4000)]
    for k, (sigma, step) in enumerate(zip(TABLE_4, BUS, strict=True)):
        expected = math.sqrt(sigma**2 + step**2 / 12)
        values = np.concatenate([errors[k] for errors in drawn])
        assert np.std(values) == pytest.approx(expected, rel=4 / math.sqrt(2 * 4000))
        assert abs(np.mean(values)) < 4 * expected / math.sqrt(4000)
    shapes = {name: errors.shape for name, errors in zip(Variables._fields, drawn[0], strict=True)}
    assert shapes.pop("azimuth_deg") == (60,)
    assert set(shapes.values()) == {(1,)}


def test_without_errors_nothing_moves(white_mountains: Terrain) -> None:
    setup = MOUNTAINS._replace(sigma=Variables(), step=NO_STEPS, post_noise_m=0.0, pairing="first")
    found = simulate(around(white_mountains.grid, setup), setup, range(2))
    assert len(found.residuals.front) == found.shadowed > 50
    assert not found.residuals.front.any()
    assert not found.residuals.back.any()


def test_an_error_of_height_moves_the_far_end_of_a_shadow_as_the_triangle_says() -> None:
    """From 400 m over a plain, past the edge of a mesa, 200 m high and 5000 m away, the ground is seen from 10000 m on.

    B = d h / (h - t), so dB/dh = -d t / (h - t)^2 = -25: 5 m of height are 125 m of range, and the edge stays.
    """
    d, t, h, sigma_m, runs = 5000.0, 200.0, 400.0, 5.0, 400
    setup = Setup(
        true=Variables(LATITUDE, LONGITUDE, h, tilt_deg=-2.0),
        sigma=Variables(height_m=sigma_m),
        step=NO_STEPS,
        post_noise_m=0.0,
        bins=360,
        bin_width_m=BIN_M,
        beam=PENCIL,
        sizes=(3, 360),
        pairing="overlap",
        seed=8,
        radials=1,
    )
    found = simulate(mesa(3500.0, d, t), setup, range(runs))
    assert (found.shadowed, found.lost, len(found.residuals.front)) == (runs, 0, runs)
    assert set(found.residuals.front.tolist()) <= {-1.0, 0.0, 1.0}
    expected_bins = d * t / (h - t) ** 2 * sigma_m / BIN_M
    assert moments(found.residuals.back).sigma == pytest.approx(expected_bins, rel=4 / math.sqrt(2 * runs))


def test_a_run_is_the_same_whatever_runs_beside_it(white_mountains: Terrain) -> None:
    grid = around(white_mountains.grid, MOUNTAINS)
    together = simulate(grid, MOUNTAINS, range(4))
    apart = Outcome.joined([simulate(grid, MOUNTAINS, range(2)), simulate(grid, MOUNTAINS, range(2, 4))])
    other = simulate(grid, MOUNTAINS._replace(seed=4), range(4))
    for edge in ("front", "back"):
        np.testing.assert_array_equal(getattr(together.residuals, edge), getattr(apart.residuals, edge))
    assert together[1:] == apart[1:]
    assert together.residuals.back.tolist() != other.residuals.back.tolist()


def test_each_kind_of_error_moves_shadows_and_rougher_posts_move_more(white_mountains: Terrain) -> None:
    grid = around(white_mountains.grid, MOUNTAINS)
    calm = MOUNTAINS._replace(step=NO_STEPS, post_noise_m=0.0, sigma=Variables())
    alone = {
        "sensors": calm._replace(sigma=TABLE_4),
        "bus": calm._replace(step=BUS),
        "posts": calm._replace(post_noise_m=3.0),
        "rougher posts": calm._replace(post_noise_m=10.0),
    }
    moved = {name: np.count_nonzero(simulate(grid, setup, range(8)).residuals.front) for name, setup in alone.items()}
    assert min(moved.values()) > 0
    assert moved["posts"] < moved["rougher posts"]


def test_the_part_of_the_terrain_that_is_reached_gives_the_same_shadows(white_mountains: Terrain) -> None:
    part = around(white_mountains.grid, MOUNTAINS)
    assert part.height_m.size < white_mountains.grid.height_m.size / 4
    ones = np.ones(72)
    azimuth = np.radians(np.arange(0.0, 360.0, 5.0))
    pointing = Pointing(44.5 * ones, -71.5 * ones, 800.0 * ones, azimuth, np.zeros(72))
    states = [predict(grid, pointing, 256, 2 * BIN_M, Beam()) for grid in (white_mountains.grid, part)]
    np.testing.assert_array_equal(states[0][0], states[1][0])
    assert not states[1][1].any()


def test_radials_that_leave_the_terrain_are_counted_and_give_nothing(white_mountains: Terrain) -> None:
    at_the_edge = MOUNTAINS._replace(true=Variables(44.5, -71.99, 800.0))
    found = simulate(around(white_mountains.grid, at_the_edge), at_the_edge, range(2))
    inside = simulate(around(white_mountains.grid, MOUNTAINS), MOUNTAINS, range(2))
    assert inside.lost == 0
    assert 40 < found.lost < 80  # of 120, those with a westward part
