"""Many short flights over the built-in cell."""

import numpy as np
import pytest

from simulators import scenario
from simulators.campaign import draw_legs
from simulators.traffic import prepare

BASE = scenario.white_mountains()


def test_legs_are_repeatable_and_each_has_its_own_place_heading_and_seed() -> None:
    legs = list(draw_legs(BASE, 20, seed=1))
    assert legs == list(draw_legs(BASE, 20, seed=1))
    assert len({(leg.flight.latitude_deg, leg.flight.heading_deg, leg.seed) for leg in legs}) == 20
    assert min(leg.flight.height_m for leg in legs) > 300


def test_every_leg_stays_clear_of_the_ground_and_inside_the_file() -> None:
    for leg in draw_legs(BASE, 4, seed=2):
        simulation = prepare(leg)
        truth = simulation.trajectory.at(np.linspace(0, leg.flight.total_s, 30))
        ground = simulation.ground.elevation(*simulation.ground.locate(truth.latitude_deg, truth.longitude_deg))
        assert np.all(truth.height_m - ground > 150)


def test_a_file_too_small_for_the_range_is_refused() -> None:
    wide = BASE.model_copy(update={"radar": BASE.radar.model_copy(update={"range_nm": 40.0})})
    with pytest.raises(ValueError, match="too small"):
        next(draw_legs(wide, 1, seed=1))
