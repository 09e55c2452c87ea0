"""Which errors the monitor sees, and how often: `make sensitivity`.

The same drawn legs are flown under one error after the other; their seed is neither the calibration's, the demo's nor
that of `make integrity`. The table goes to docs/sensitivity.md too. It measures and claims nothing.
"""

import tempfile
from pathlib import Path

from benchmarks.flights import ENOUGH_PAIRS, Flight, detections, fly_all
from gateway.demo import CALIBRATION, shift_terrain
from monitor.calibration import load_calibration
from simulators.campaign import draw_legs
from simulators.scenario import Fault, white_mountains

LEGS, SEED = 24, 970_000
P_FA = 1e-4
SENSITIVITY = Path(__file__).parents[1] / "docs" / "sensitivity.md"
NO_SHIFT: dict[str, float] = {}
ERRORS = {  # what the monitor's terrain is shifted by, and by how much its heading is wrong, degrees
    "none": (NO_SHIFT, 0.0),
    **{f"terrain {metres:.0f} m east": ({"east_m": metres}, 0.0) for metres in (100.0, 200.0, 300.0, 500.0)},
    **{f"terrain {metres:.0f} m north": ({"north_m": metres}, 0.0) for metres in (200.0, 500.0)},
    **{f"terrain {metres:+.0f} m up": ({"up_m": metres}, 0.0) for metres in (20.0, 50.0, 100.0, -50.0)},
    **{f"heading {degrees:+.0f} deg": (NO_SHIFT, degrees) for degrees in (1.0, 2.0)},
}


def main() -> None:
    """Fly, count, print, and write down."""
    lines = [f"{'error':22s} alerts  legs"]
    print(lines[0])
    for name, (shift, heading_deg) in ERRORS.items():
        found, enough = alerts(shift, heading_deg)
        lines.append(f"{name:22s} {found:6d} {enough:5d}")
        print(lines[-1], flush=True)
    about = (
        f"Written by `make sensitivity`: of the legs with N_D >= {ENOUGH_PAIRS} in a scan, how many alert within two",
        f"scans at a P_FA of {P_FA:g} a scan. Under each error the same {LEGS} legs are flown, over the White",
        "Mountains with the demo's radar and calibration.",
    )
    SENSITIVITY.write_text("\n".join(("# Measured sensitivity", "", *about, "", "```", *lines, "```", "")))


def alerts(shift: dict[str, float], heading_deg: float, legs: int = LEGS) -> tuple[int, int]:
    """How many legs alert under an error, and of how many with enough pairs."""
    base = white_mountains(seed=SEED).model_copy(
        update={"faults": (Fault(name="heading_offset", heading_deg=heading_deg),)}
    )
    calibration = load_calibration(CALIBRATION)
    with tempfile.TemporaryDirectory() as directory:
        terrain = shift_terrain(base.world.path, Path(directory) / "terrain.tif", **shift)
        drawn = draw_legs(base, legs, SEED)
        return detections(list(fly_all(Flight(leg, terrain, P_FA, calibration) for leg in drawn)))


if __name__ == "__main__":
    main()
