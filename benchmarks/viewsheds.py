"""Line of sight over stored terrain by two programs that share nothing with ours: gdal_viewshed and xarray-spatial.

Both work on a raster in metres, so the terrain is warped to an azimuthal equidistant grid about the observer, on which
distances from there are those along the ellipsoid.
"""

import shutil
import subprocess
import tempfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pymap3d
import rasterio
import xarray
from numpy.typing import NDArray
from rasterio.enums import Resampling
from rasterio.transform import Affine
from rasterio.warp import reproject
from xrspatial import viewshed

from monitor.geodesy import SEMI_MAJOR_M

GDAL = "gdal_viewshed"
FAR_BELOW_M = -1000.0  # where the terrain has a void, which then hides nothing


class Surroundings(NamedTuple):
    """Heights (n, n) in metres about an observer in the middle cell; rows southward, `cell_m` apart."""

    height_m: NDArray[np.float32]
    cell_m: float
    latitude_deg: float
    longitude_deg: float

    @property
    def middle(self) -> int:
        """Row and column of the observer's cell."""
        return len(self.height_m) // 2

    @property
    def ground_m(self) -> float:
        """Below the observer."""
        return float(self.height_m[self.middle, self.middle])

    @property
    def transform(self) -> Affine:
        """From columns and rows to metres east and north of the observer."""
        edge = (self.middle + 0.5) * self.cell_m
        return Affine(self.cell_m, 0, -edge, 0, -self.cell_m, edge)

    @property
    def crs(self) -> str:
        """The grid's coordinate reference system."""
        return f"+proj=aeqd +lat_0={self.latitude_deg} +lon_0={self.longitude_deg} +ellps=WGS84 +units=m"

    @property
    def earth_radius_m(self) -> float:
        """The Gaussian radius at the observer: the mean of all azimuths' radii of curvature."""
        radii = (pymap3d.rcurve.meridian(self.latitude_deg), pymap3d.rcurve.transverse(self.latitude_deg))
        return float(np.sqrt(np.prod(radii)))


def surroundings(
    terrain: Path, latitude_deg: float, longitude_deg: float, reach_m: float, cell_m: float
) -> Surroundings:
    """The terrain as GDAL's bilinear warping gives it, a little wider than `reach_m` to each side of a place."""
    size = 2 * (int(reach_m / cell_m) + 4) + 1
    about = Surroundings(np.empty((size, size), np.float32), cell_m, latitude_deg, longitude_deg)
    grid = {"dst_crs": about.crs, "dst_transform": about.transform, "dst_nodata": FAR_BELOW_M}
    with rasterio.open(terrain) as source:
        reproject(rasterio.band(source, 1), about.height_m, **grid, resampling=Resampling.bilinear, tolerance=0)
    return about


def by_gdal(about: Surroundings, above_ground_m: float, refraction_k: float) -> NDArray[np.bool_]:
    """Which cells gdal_viewshed says are seen. Its -cc counts with the ellipsoid's semi-major axis."""
    curvature = SEMI_MAJOR_M / about.earth_radius_m / refraction_k
    with tempfile.TemporaryDirectory() as directory:
        stored, seen = Path(directory) / "terrain.tif", Path(directory) / "seen.tif"
        write(about, stored)
        run_gdal(stored, seen, 0, 0, above_ground_m, "-cc", repr(curvature))
        with rasterio.open(seen) as file:
            return np.asarray(file.read(1) > 0)


def by_xarray_spatial(about: Surroundings, above_ground_m: float, refraction_k: float) -> NDArray[np.bool_]:
    """Which cells xarray-spatial says are seen; it knows no curvature, so the terrain is lowered for it beforehand."""
    place = (np.arange(len(about.height_m)) - about.middle) * about.cell_m
    drop = (place**2 + place[:, None] ** 2) / (2 * refraction_k * about.earth_radius_m)
    raster = xarray.DataArray(about.height_m - drop, dims=("y", "x"), coords={"y": -place, "x": place})
    return np.asarray(viewshed(raster, x=0, y=0, observer_elev=above_ground_m).values >= 0)


def write(about: Surroundings, path: Path) -> None:
    """As a GeoTIFF."""
    rows, columns = about.height_m.shape
    profile = {"driver": "GTiff", "height": rows, "width": columns, "count": 1, "dtype": "float32"}
    with rasterio.open(path, "w", **profile, crs=about.crs, transform=about.transform) as file:
        file.write(about.height_m, 1)


def run_gdal(stored: Path, seen: Path, x: float, y: float, above_ground_m: float, *options: str) -> None:
    """One call of gdal_viewshed, with a place in the coordinates of the file."""
    place = ("-ox", repr(x), "-oy", repr(y), "-oz", repr(above_ground_m))
    command = [gdal(), "-q", *place, *options, str(stored), str(seen)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)  # noqa: S603 # no part comes from outside


def gdal() -> str:
    """Where gdal_viewshed is."""
    path = shutil.which(GDAL)
    if path is None:
        raise SystemExit(f"{GDAL} is not installed: apt-get install gdal-bin")
    return path


def gdal_version() -> str:
    """As its sister program says, since it does not."""
    said = subprocess.run(["gdalinfo", "--version"], check=True, capture_output=True, text=True)  # noqa: S607 # PATH
    return said.stdout.partition(",")[0]


Sight = Callable[[Surroundings, float, float], NDArray[np.bool_]]
TOOLS: dict[str, tuple[Callable[[], str], Sight]] = {
    GDAL: (gdal_version, by_gdal),
    "xarray-spatial": (lambda: version("xarray-spatial"), by_xarray_spatial),
}
