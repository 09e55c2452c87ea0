"""The terrain thread's own errors by altitude, by either pairing, and what eq. (11) makes of them."""

from benchmarks.evidence.flown import TERRAINS
from benchmarks.evidence.tables import table
from gateway.calibrate.dem import ABOVE_GROUND_M, as_published, figures, monte_carlo, place_of, setup_of
from monitor.monte_carlo import Setup, Variables
from monitor.settings import MonitorSettings
from monitor.terrain import Terrain, open_terrain

RUNS = 100
SEED = 1_500_000
HEADINGS = (
    "terrain, pairing", "m above ground", "pairs", "sigma front", "sigma back", "sigma centre", "by (11)", "correlation"
)  # fmt: skip


def page() -> str:
    """A row for each terrain, pairing and altitude; the paper's radar and errors over the middle of the tile."""
    rows = []
    for name, path in TERRAINS.items():
        terrain = open_terrain(path)
        place = place_of(terrain, None)
        true = Variables(place.latitude_deg, place.longitude_deg, place.ground_m)
        published = as_published(setup_of(true, MonitorSettings(), 512, 10.0, 3.0, SEED))
        for setup in (published, published._replace(pairing="overlap")):
            rows += _rows(name, terrain, setup, place.ground_m)
    return table(HEADINGS, rows)


def _rows(name: str, terrain: Terrain, setup: Setup, ground_m: float) -> list[list[str]]:
    heights_m = [ground_m + above for above in ABOVE_GROUND_M]
    rows = []
    for above_m, row in zip(ABOVE_GROUND_M, monte_carlo(terrain.grid, setup, heights_m, RUNS), strict=True):
        said = figures(row)
        sigmas = (
            said[f"{what}_bins"] for what in ("sigma_front", "sigma_back", "sigma_centre", "sigma_centre_by_eq_11")
        )
        correlation = said["front_back_correlation"]
        rows.append(
            [
                f"{name}, {setup.pairing}",
                f"{above_m:.0f}",
                f"{said['pairs']}",
                *("" if sigma is None else f"{sigma:.2f}" for sigma in sigmas),
                "" if correlation is None else f"{correlation:.2f}",
            ]
        )
    return rows
