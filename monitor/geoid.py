"""Height of the geoid over the WGS 84 ellipsoid: what lies between a GNSS height and a height above mean sea level."""

from functools import cache
from pathlib import Path
from typing import Final

from monitor.terrain import Terrain, open_terrain

GRID: Final = Path(__file__).with_name("data") / "egm96_15min.tif"


def undulation_m(latitude_deg: float, longitude_deg: float) -> float:
    """EGM96 undulation in metres at WGS 84 degrees: h = H + N, bilinear in a grid of 15 arc-minutes."""
    return float(_grid().elevation(latitude_deg, longitude_deg))


@cache
def _grid() -> Terrain:
    return open_terrain(GRID)
