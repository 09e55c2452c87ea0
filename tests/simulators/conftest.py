"""Ground made to measure."""

from collections.abc import Callable

import numpy as np
import pyproj
import pytest
from hypothesis import settings
from numpy.typing import NDArray

from simulators.terrain import Ground

Floats = NDArray[np.float64]

# A first example may compile or load tables, so a time limit on an example would measure that.
settings.register_profile("patient", deadline=None)
settings.load_profile("patient")


@pytest.fixture(scope="session")
def make_ground() -> Callable[[Callable[[Floats, Floats], Floats]], Ground]:
    """Ground from a function of east and north in metres, 12 km each way from the antenna, posts 10 m apart."""

    def make(height: Callable[[Floats, Floats], Floats]) -> Ground:
        axis = np.arange(-12_000.0, 12_000.0 + 10, 10.0)
        heights = np.broadcast_to(height(axis[None, :], axis[:, None]), (len(axis), len(axis)))
        projection = pyproj.Proj(proj="aeqd", lat_0=45.0, lon_0=7.0, ellps="WGS84")
        return Ground(np.array(heights, np.float32), float(axis[0]), float(axis[0]), 10.0, projection)

    return make
