"""The terrain thread: which range bins the stored terrain should light, for every radial of a scan.

Young, Uijt de Haag and Campbell (2004), section 1.2, with three refinements a real beam needs. The thread runs on a
fan of azimuths across the beam and a bin is lit if any of them lights it; the ground point of a bin lies at its *slant*
range; the Earth's curvature with standard refraction lowers far terrain. Tangents are taken of the true elevation, with
the horizontal distance below the line where eq. (5) writes the slant range, since the beam's limits are tangents too.
"""

import math
from typing import Any, NamedTuple, Self

import numpy as np
from numba import njit
from numpy.typing import NDArray

from monitor.ceiling import clear_m
from monitor.geodesy import Ray, along, bend, curvature_radii, ray
from monitor.settings import MonitorSettings
from monitor.shade import DEM_INITIAL, walk
from monitor.terrain import Extent, Grid, Real, bilinear, blend, corners, locate, sample

SETTLED = 0.1  # of a bin: how far a bin's ground may move it and its place still counts as found
LEVELS = (16, 4, 1)  # bins whose ground is looked up at once: every 16th, every fourth, every one
LANES = 16  # bins a loop takes at a time; the first looked up is a multiple, or the rest would go one by one
MOST_LOOKS = 40  # half of them halve a range setting to less than a centimetre

# Of single precision eight bins go at a time, of double four. A place is then off by about a centimetre in 100 km,
# since it is counted from the antenna's own post, and a tangent by a part in 10^7. Any other number in their midst, be
# it a whole one, would turn them into doubles.
single: Any = np.float32  # or mypy would have Python's floats where these stand
ZERO, ONE, NONE = single(0), single(1), single(math.nan)


class Beam(NamedTuple):
    """How the antenna is modelled."""

    width_deg: float = 3.5  # one-way 3 dB
    azimuth_fan: int = 7  # sub-azimuths; 1 is the paper's boresight form
    azimuth_span: float = 0.75  # beam widths each side, where the two-way gain is 13.5 dB down
    refraction_k: float = 4 / 3  # effective Earth radius factor; inf is the paper's flat Earth
    range_reference: str = "centre"  # or "far_edge", the paper's R_j = j dR

    @classmethod
    def of(cls, settings: MonitorSettings) -> Self:
        """The beam that the settings describe."""
        s = settings
        return cls(s.beam_width_deg, s.azimuth_fan, s.azimuth_span, s.refraction_k, s.range_reference)


class Pointing(NamedTuple):
    """Where the antenna is and looks for each radial, arrays (n,): WGS 84 degrees, metres MSL, local-level radians."""

    latitude_deg: NDArray[np.float64]
    longitude_deg: NDArray[np.float64]
    height_m: NDArray[np.float64]
    azimuth_rad: NDArray[np.float64]
    elevation_rad: NDArray[np.float64]

    def over(self, extent: Extent) -> "Pointing":
        """The same, with longitudes on the scale of the terrain that is looked at: the kernels know no date line."""
        return self._replace(longitude_deg=extent.framed(self.longitude_deg))


class Bins(NamedTuple):
    """Slant ranges in metres of the bins at each of `LEVELS`, and room to look up their ground. Made by `bins_at`."""

    levels_m: tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]
    places: NDArray[np.float32]
    post: NDArray[np.uint32]
    pairs: NDArray[np.complex64]


class Way(NamedTuple):
    """A ray in posts of the grid; and, if all of it is surely `inside`, from its `origin` in single precision.

    The origin is the post north-west of where the ray begins, by its number in the grid. Made by `_way`.
    """

    track: Ray
    inside: bool
    origin: np.uint32
    near: Ray


@njit(cache=True)
def bins_at(ranges_m: NDArray[np.float64]) -> Bins:
    """Bins at slant ranges (n,) in rising order."""
    n, every_m = ranges_m.size, ranges_m.astype(np.float32)
    levels_m = (every_m[::16].copy(), every_m[::4].copy(), every_m)
    return Bins(levels_m, np.empty((5, n), np.float32), np.empty(n, np.uint32), np.empty((2, n), np.complex64))


def predict(
    grid: Grid, pointing: Pointing, bins: int, bin_width_m: float, beam: Beam
) -> tuple[NDArray[np.int8], NDArray[np.bool_]]:
    """States of the terrain thread i1 (n, bins), and which radials (n,) met a void post or left the terrain."""
    offset = {"centre": 0.5, "far_edge": 0.0}[beam.range_reference]
    ranges_m = (np.arange(1, bins + 1) - offset) * bin_width_m
    width = math.radians(beam.width_deg)
    fan = width * beam.azimuth_span * np.linspace(-1, 1, beam.azimuth_fan) if beam.azimuth_fan > 1 else np.zeros(1)
    states, void = _predict(grid, *pointing, ranges_m, width / 2, fan, beam.refraction_k)
    return states, void


@njit(cache=True)
def _predict(  # type: ignore[no-untyped-def] # typed by predict
    grid, latitude_deg, longitude_deg, height_m, azimuth_rad, elevation_rad, ranges_m, half_beam_rad, fan_rad, k
):
    states = np.full((azimuth_rad.size, ranges_m.size), DEM_INITIAL, np.int8)
    void = np.zeros(azimuth_rad.size, np.bool_)
    delta = np.empty(ranges_m.size, np.float32)
    bins = bins_at(ranges_m)
    for i in range(azimuth_rad.size):
        dmin = single(math.tan(elevation_rad[i] - half_beam_rad))
        dmax = single(math.tan(elevation_rad[i] + half_beam_rad))
        for f in range(fan_rad.size):
            azimuth = azimuth_rad[i] + fan_rad[f]
            void[i] |= tangents(grid, latitude_deg[i], longitude_deg[i], height_m[i], azimuth, bins, k, dmin, delta)
            walk(delta, dmin, dmax, states[i])
    return states, void


@njit(cache=True, error_model="numpy")
def tangents(
    grid: Grid,
    latitude_deg: float,
    longitude_deg: float,
    height_m: float,
    azimuth_rad: float,
    bins: Bins,
    k: float,
    dmin: float,
    delta: NDArray[np.floating],
) -> bool:
    """Tangent of the elevation of the ground at each slant range, into `delta`; True if any post was missing.

    Bins nearer than the ground below get -infinity, those from the first missing post on NaN. In the triangle of
    antenna, ground and the Earth's centre the slant range squared is the height difference squared plus the square of
    the chord at the mean height, whatever the curvature, so only the elevation sees the drop.

    The distance of a bin's ground depends on its height, and the height on the distance. To wait for the ground of the
    bin before takes a processor several times as long as to look, so guesses come from every fourth bin instead, and
    theirs from every sixteenth. A bin that its own ground then moves by more than `SETTLED` is settled alone, so that
    every point lies within a tenth of a bin of the stored ground.

    Bins before the first that might exceed `dmin` may get -infinity too: the machine stays in its first state there,
    so none is looked up but the last, from whose ground the next may start. Curvature (k > 0) only lowers.
    """
    meridian, prime = curvature_radii(math.radians(latitude_deg))
    drop = 1 / (2 * k * math.sqrt(meridian * prime))
    below = sample(grid, latitude_deg, longitude_deg)
    if math.isnan(below):
        below = height_m
    track = _in_posts(grid, ray(latitude_deg, longitude_deg, (height_m + below) / 2, azimuth_rad))
    ranges_m = bins.levels_m[-1]
    tolerance = single(SETTLED) * (ranges_m[1] - ranges_m[0]) if ranges_m.size > 1 else ZERO
    clear = clear_m(grid.ceiling_m, track, height_m, dmin, tolerance, ranges_m[-1]) if drop >= 0 else 0.0
    begin = max(_within(ranges_m, clear) - 1, 0) // LANES * LANES
    _look(grid.height_m, _way(track, ranges_m[-1], grid.height_m.shape), single(height_m), single(below), bins, begin)
    ground, guessed = bins.places[0][begin:], bins.places[2][begin:]
    end = _settled(single(height_m), ground, guessed, ranges_m[begin:], tolerance, single(drop), delta[begin:])
    ground = bins.places[0]
    first = max(begin, _within(ranges_m, abs(height_m - below)))
    delta[:first] = -math.inf
    for j in range(first, begin + end):
        if math.isnan(delta[j]):
            before = ground[j - 1] if j else single(below)
            for guess in (ground[j], before):  # the second where the first leads over a void
                ground[j] = _settle(grid.height_m, track, height_m, guess, ranges_m[j], tolerance)
                if not math.isnan(ground[j]):
                    break
            if math.isnan(ground[j]):
                delta[j:] = math.nan
                return True
            depth = height_m - ground[j]
            s = _distance(ranges_m[j], depth)
            delta[j] = _lowered(-depth / s, s * drop)
    return False


@njit(cache=True)
def _within(ranges_m, limit_m):  # type: ignore[no-untyped-def] # typed by tangents
    """How many bins lie no farther than a limit; a search would cost a machine's first start a second."""
    count = 0
    for j in range(ranges_m.size):
        count += ranges_m[j] <= limit_m
    return count


@njit(cache=True, error_model="numpy")
def _settled(height_m, ground, guessed, ranges_m, tolerance, drop, delta):  # type: ignore[no-untyped-def] # by tangents
    """The tangents of bins that lie where they were guessed, NaN for others, and how many there are up to the last."""
    end = 0
    for j in range(ranges_m.size):
        depth = height_m - ground[j]
        s = _distance(ranges_m[j], depth)
        settled = (abs(s - guessed[j]) <= tolerance) & (s > ZERO)
        delta[j] = _lowered(-depth / s, s * drop) if settled else NONE
        end = max(end, 0 if settled else j + 1)
    return end


@njit(cache=True, error_model="numpy")
def _look(post_m, way, height_m, below_m, bins, begin):  # type: ignore[no-untyped-def] # typed by tangents
    """Ground for each bin from `begin` on into the first of `places`, where it was looked up into the third.

    Several plain loops, because each goes eight bins at a time where one loop over all of it would go bin by bin; all
    count from 0, or numba would ask of each index whether it is negative.
    """
    bins.places[0, 0] = below_m
    known = 1
    for level in range(len(LEVELS)):
        first = (
            begin // (LANES * LEVELS[level]) * LANES if level else 0
        )  # all of the first: they start from the ground below
        range_m = bins.levels_m[level][first:]
        size = range_m.size
        ground, guess, distance = bins.places[0][first:], bins.places[1][:size], bins.places[2][first:]
        coarse = bins.places[0][first // 4 : known]
        for j in range(size):
            guess[j] = coarse[min(j + 2 >> 2, coarse.size - 1)]  # the nearest of the level before
        for j in range(size):
            distance[j] = _distance(range_m[j], height_m - guess[j])
        _heights(post_m, way, distance[:size], bins, ground)
        known = first + size


@njit(cache=True, error_model="numpy")
def _heights(post_m, way, distance, bins, ground):  # type: ignore[no-untyped-def] # typed by tangents
    """Ground at each distance along a ray, in loops as above."""
    flat, columns = post_m.reshape(post_m.size), np.uint32(post_m.shape[1])
    size = distance.size
    south, east, post = bins.places[3][:size], bins.places[4][:size], bins.post[:size]
    upper, lower = bins.pairs[0][:size], bins.pairs[1][:size]
    if way.inside:
        for j in range(size):
            row, column = along(way.near, distance[j])
            i, k = np.floor(row), np.floor(column)
            south[j], east[j] = row - i, column - k
            post[j] = np.uint32(np.uint32(np.int32(i)) * columns) + np.uint32(np.int32(k)) + way.origin
    else:
        for j in range(size):
            row, column = along(way.track, distance[j])
            south_of, east_of, south[j], east[j] = locate(post_m, row, column)
            post[j] = np.uint32(south_of * columns) + east_of
    for j in range(size):
        upper[j], lower[j] = corners(flat, post[j], columns)
    for j in range(size):
        ground[j] = blend(upper[j], lower[j], south[j], east[j])


@njit(cache=True)
def stays_inside(track: Ray, far_m: float, shape: tuple[int, int]) -> bool:
    """Whether a ray in posts surely stays in the grid up to a distance: its tangent at the start does, by the bend."""
    aside = far_m * bend(track, far_m) + 0.001
    row, column = track.lat0 + track.lat1 * far_m, track.lon0 + track.lon1 * far_m
    return bool(
        (min(row, track.lat0) > aside)
        & (min(column, track.lon0) > aside)
        & (max(row, track.lat0) < shape[0] - 1 - aside)
        & (max(column, track.lon0) < shape[1] - 1 - aside)
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def _settle(post_m, track, height_m, ground_m, range_m, tolerance):  # type: ignore[no-untyped-def] # typed by tangents
    """The ground at one slant range, by corrections and halvings in turn: looking steeply down the former diverge.

    NaN if it is not found, as where a void begins between the places that are too near and those that are too far.
    """
    near, far = 0.0, range_m
    s = _distance(range_m, height_m - ground_m)
    for look in range(MOST_LOOKS):
        r, c = along(track, s)
        ground_m = bilinear(post_m, r, c)
        found = _distance(range_m, height_m - ground_m)
        if abs(found - s) <= tolerance:
            return ground_m
        near, far = (s, far) if found > s else (near, s)
        s = found if near < found < far and look % 2 == 0 else (near + far) / 2
    return math.nan


@njit(cache=True)
def _distance(range_m: Real, depth_m: Real) -> Real:
    """The horizontal side of the triangle of a slant range and a height difference; 0 if there is none."""
    s2 = range_m**2 - depth_m**2
    return math.sqrt(s2 if s2 > ZERO else ZERO)


@njit(cache=True)
def _lowered(tangent: Real, drop_rad: Real) -> Real:
    """The tangent of an elevation less the small angle by which the Earth's curvature turns the chord."""
    return tangent - drop_rad * (ONE + tangent**2)


@njit(cache=True)
def _way(r, far_m, shape):  # type: ignore[no-untyped-def] # typed by tangents
    i, k = math.floor(r.lat0), math.floor(r.lon0)
    near = Ray(
        single(r.lat0 - i), single(r.lat1), single(r.lat2), single(r.lat3), single(r.lat4), single(r.lat5),
        single(r.lon0 - k), single(r.lon1), single(r.lon2), single(r.lon3), single(r.lon4), single(r.lon5),
    )  # fmt: skip
    return Way(r, stays_inside(r, far_m, shape), np.uint32(i * shape[1] + k), near)


@njit(cache=True)
def _in_posts(grid: Grid, r: Ray) -> Ray:
    """The ray in rows and columns of the grid where it has degrees of latitude and longitude."""
    south, east = -1 / grid.row_deg, 1 / grid.column_deg
    return Ray(
        (r.lat0 - grid.north_deg) * south,
        r.lat1 * south, r.lat2 * south, r.lat3 * south, r.lat4 * south, r.lat5 * south,
        (r.lon0 - grid.west_deg) * east,
        r.lon1 * east, r.lon2 * east, r.lon3 * east, r.lon4 * east, r.lon5 * east,
    )  # fmt: skip
