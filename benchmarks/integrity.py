"""How often the monitor alerts when nothing is wrong, and when the terrain is 500 m off: `make integrity`.

The rates go to docs/rates.md too. The flights' seeds are neither the calibration's nor the demo's. Each leg is one new
place and heading over the White Mountains; a fault-free leg is one scan, a leg with shifted terrain two. Exits 1 if a
claim does not hold.
"""

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from scipy.stats import binom

from benchmarks.flights import ENOUGH_PAIRS, Flight, detections, fly_all
from gateway.demo import CALIBRATION, SHIFT_EAST_M, shift_terrain
from monitor.calibration import load_calibration
from monitor.disparity import robust_threshold
from monitor.verdict import UNAVAILABLE, Verdict
from simulators.campaign import draw_legs
from simulators.scenario import Scenario, white_mountains

FAULT_FREE_SCANS, FAULT_FREE_LEGS, FAULT_FREE_SEED = 900, 1100, 910_000
SHIFTED_LEGS, SHIFTED_SEED = 60, 950_000
P_FAS = (1e-2, 1e-3)
P_FA_SHIFTED = 1e-4
CONFIDENCE = 0.99
RATES = Path(__file__).parents[1] / "docs" / "rates.md"
DETECTED_SHARE = 0.95


def main() -> None:
    """Fly, count, print, and judge the claims."""
    lines: list[str] = []

    def say(line: str) -> None:
        print(line, flush=True)
        lines.append(line)

    good = false_alerts(white_mountains(seed=FAULT_FREE_SEED), say)
    good &= shifted_alerts(white_mountains(seed=SHIFTED_SEED), say)
    RATES.write_text("\n".join(("# Measured rates", "", "Written by `make integrity`.", "", "```", *lines, "```", "")))
    sys.exit(0 if good else 1)


def false_alerts(base: Scenario, say: Callable[[str], None]) -> bool:
    """Alerts over fault-free scans with a verdict, against the binomial bound of each P_FA; flown once for all."""
    calibration = load_calibration(CALIBRATION)
    legs = draw_legs(base, FAULT_FREE_LEGS, FAULT_FREE_SEED, scans=1)
    judged: list[Verdict] = []
    unavailable = 0
    for scans in fly_all(Flight(leg, base.world.path, P_FAS[0], calibration) for leg in legs):
        verdict = scans[0].verdict
        if verdict.verdict == UNAVAILABLE:
            unavailable += 1
        elif len(judged) < FAULT_FREE_SCANS:
            judged.append(verdict)
    say(f"fault-free: {len(judged)} scans with a verdict, each at a new place; {unavailable} more without one")
    good = len(judged) == FAULT_FREE_SCANS
    for p_fa in P_FAS:
        alerts = sum((v.q or 0) > robust_threshold(v.n_pairs, p_fa, calibration.variance_factor) for v in judged)
        bound = int(binom.ppf(CONFIDENCE, len(judged), p_fa))
        held = alerts <= bound
        say(f"  P_FA {p_fa:g}: {alerts} alerts, the binomial {CONFIDENCE:.0%} bound is {bound}: {_word(held)}")
        good &= held
    return good


def shifted_alerts(base: Scenario, say: Callable[[str], None]) -> bool:
    """Legs over shifted terrain that alert within two scans, of those with enough pairs in either."""
    calibration = load_calibration(CALIBRATION)
    with tempfile.TemporaryDirectory() as directory:
        shifted = shift_terrain(base.world.path, Path(directory) / "shifted.tif", east_m=SHIFT_EAST_M)
        legs = draw_legs(base, SHIFTED_LEGS, SHIFTED_SEED, scans=2)
        flown = list(fly_all(Flight(leg, shifted, P_FA_SHIFTED, calibration) for leg in legs))
    found, enough = detections(flown)
    share = found / enough
    say(
        f"terrain {SHIFT_EAST_M:.0f} m east, P_FA {P_FA_SHIFTED:g}: {found} of {enough} legs with N_D >= "
        f"{ENOUGH_PAIRS} (of {len(flown)}) alert within two scans, {share:.1%}: "
        f"{_word(share >= DETECTED_SHARE)}"
    )
    return share >= DETECTED_SHARE


def _word(good: bool) -> str:
    return "holds" if good else "FAILS"


if __name__ == "__main__":
    main()
