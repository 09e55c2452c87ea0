"""Make the calibration file of the demo's radar: `make calibration`.

The flights are drawn over the demo's terrain with seeds that neither the demo nor the rate measurements use. One half
of the scans is fitted, the other half checks the fit, and the checked rates go into the file.
"""

from benchmarks.flights import Flight, fly_all
from gateway.demo import CALIBRATION
from monitor.fitting import fit
from monitor.settings import MonitorSettings
from simulators.campaign import draw_legs
from simulators.scenario import white_mountains

LEGS = 560
SEED = 41_000
CLEARANCE_M = (150.0, 500.0)  # the demo flies lower over the ground than legs of 250 m would
MINIMUM_PAIRS = 16
P_FAS = (1e-1, 1e-2, 1e-3)


def main() -> None:
    """Fly, fit, check, write."""
    base = white_mountains(seed=SEED)
    flights = [Flight(leg, base.world.path, P_FAS[0]) for leg in draw_legs(base, LEGS, SEED, clearance_m=CLEARANCE_M)]
    scans = [scan.sample for flight in fly_all(flights) for scan in flight]
    half = len(scans) // 2
    made = fit(
        scans[:half],
        scans[half:],
        P_FAS,
        MonitorSettings(minimum_pairs=MINIMUM_PAIRS),
        name="demo-white-mountains",
        provenance=f"{len(scans)} simulated fault-free scans of {LEGS} flights over N44W072, seed {SEED}, "
        f"{CLEARANCE_M[0]:.0f} to {CLEARANCE_M[1]:.0f} m above the highest ground below, "
        "median signal-to-noise ratio 18 dB at 5 to 10 NM",
        bins=512,
        range_nm=base.radar.range_nm,
        radar_profile=base.radar.payload,
    )
    CALIBRATION.write_text(made.model_dump_json(indent=2) + "\n")
    print(made.model_dump_json(indent=2))


if __name__ == "__main__":
    main()
