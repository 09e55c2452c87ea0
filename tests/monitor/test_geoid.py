"""The geoid against the points that its publisher gives with the grid."""

import pytest

from monitor.geoid import undulation_m

# NGA's OUTPUT.DAT for the test points of the EGM96 interpolation program; that program interpolates by a spline.
PUBLISHED = [
    (38.628155, 269.779155, -31.628),
    (-14.621217, 305.021114, -2.969),
    (46.874319, 102.448729, -43.575),
    (-23.617446, 133.874712, 15.871),
    (38.625473, 359.9995, 50.066),
    (-0.466744, 0.0023, 17.329),
]


@pytest.mark.parametrize(("latitude", "longitude", "expected"), PUBLISHED)
def test_the_published_points_come_out_within_what_bilinear_and_spline_differ(
    latitude: float, longitude: float, expected: float
) -> None:
    assert undulation_m(latitude, longitude) == pytest.approx(expected, abs=0.2)


def test_the_grid_closes_at_the_date_line_and_at_the_poles() -> None:
    assert undulation_m(10.0, 180.0) == undulation_m(10.0, -180.0)
    assert undulation_m(10.0, 179.999) == pytest.approx(undulation_m(10.0, -179.999), abs=0.01)
    assert undulation_m(90.0, 0.0) == pytest.approx(13.61, abs=0.01)
    assert undulation_m(-90.0, 0.0) == pytest.approx(-29.53, abs=0.01)
