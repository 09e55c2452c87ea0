"""Recordings to the calibration file that the monitor loads, and to a table in the form of the paper's Table 3.

Young, Uijt de Haag and Campbell (2004), section 2. The recorded navigation is the reference trajectory and the terrain
the reference, so the residuals are disparities with the errors of both: what the monitor meets in flight.
"""

import json
import math
from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version
from typing import NamedTuple, cast

import numpy as np

from gateway.calibrate.page import Histogram
from gateway.calibrate.recorded import CELLS, LARGEST_SIZES, SHARES_OF_RANGE, Compared, Read, Setting
from gateway.console import utc
from gateway.errors import GatewayError
from gateway.names import shown
from monitor.calibration import Calibration, ShiftModel
from monitor.fitting import fit
from monitor.geodesy import NM_M
from monitor.residuals import NORMALITY_TEST, moments, normality
from monitor.shift import mean_shift, score, shift_threshold

P_FAS = (1e-1, 1e-2, 1e-3)
BY_CHANCE = 1e-6  # a mean shift that is less likely is none, if it is larger than a range bin
FLY = "fly a few hundred metres above the ground over terrain of the class in question, with the radar in map mode"
HEADINGS = ("range limit (NM)", "shadow size (bins)", "residuals", "mean (bins)", "sigma (bins)", "p if normal")
EXPLANATION = f"""Residuals of shadow centres, radar minus terrain, in range bins, over all scans. Whole shadows up
to the size and range limit are paired by their overlap, at most one pair a radial. The last column is the p value of
{NORMALITY_TEST}: small where the residuals are not normal."""


class Material(NamedTuple):
    """The scans of one radar setting, in order of time, and what was left out."""

    setting: Setting
    scans: list[Compared]
    left_out: int


def material(reads: Sequence[Read]) -> Material:
    """The scans of the commonest setting.

    Raises GatewayError if a recording is there twice, or, with what to fly, if no scan was compared.
    """
    known: dict[str, str] = {}
    for read in reads:
        if read.digest in known:
            raise GatewayError(f"{known[read.digest]} and {read.name} are the same recording: name one of them")
        known[read.digest] = read.name
    settings = Counter(scan.setting for read in reads for scan in read.scans)
    if not settings:
        refusals = sum((read.refusals for read in reads), Counter[str]())
        why = "; ".join(f"{count} scans: {reason}" for reason, count in refusals.most_common(3)) or "no scan at all"
        raise GatewayError(f"no scan of these recordings can be compared with the terrain ({why}): {FLY}")
    setting, count = settings.most_common(1)[0]
    in_time = sorted(reads, key=lambda read: read.begins_utc_ns or 0)
    scans = [scan for read in in_time for scan in read.scans if scan.setting == setting]
    return Material(setting, scans, settings.total() - count)


def table(found: Material) -> list[list[str]]:
    """A row for each range limit and largest size, as `HEADINGS` says."""
    rows = []
    for k, (share, size) in enumerate(CELLS):
        values = np.concatenate([scan.centres[k] for scan in found.scans])
        count, mean, sigma = moments(values)
        figures = (text(mean, ".2f"), text(sigma, ".2f"), text(normality(values), ".2g"))
        rows.append([f"{share * found.setting.range_nm:g}", f"1-{size}", f"{count}", *figures])
    return rows


def text(figure: float | None, form: str) -> str:
    """A figure, or a dash where there is none."""
    return "-" if figure is None else format(figure, form)


def histograms(found: Material) -> list[Histogram]:
    """The residuals of the widest class of sizes, for each range limit."""
    return [
        Histogram(
            f"up to {share * found.setting.range_nm:g} NM, 1-{LARGEST_SIZES[0]} bins",
            np.concatenate([scan.centres[CELLS.index((share, LARGEST_SIZES[0]))] for scan in found.scans]),
        )
        for share in SHARES_OF_RANGE
    ]


def calibration(name: str, reads: Sequence[Read], found: Material, least_scans: int) -> Calibration:
    """Fit to the first half of the scans and check on the second.

    Raises GatewayError, with what to fly, if fewer than `least_scans` have the pairs that a verdict needs.
    """
    settings = reads[0].settings
    if other := next((read for read in reads if read.settings != settings), None):
        raise GatewayError(
            f"{other.name} and {reads[0].name} have different monitor settings: give one rack file by -c"
        )
    needed = settings.pairs_needed
    usable = [k for k, scan in enumerate(found.scans) if len(scan.sample.disparities) >= needed]
    if len(usable) < least_scans:
        raise GatewayError(
            f"{len(usable)} of {len(found.scans)} scans have the {needed} pairs of shadows that a verdict needs, and "
            f"{least_scans} are wanted: {FLY}, for longer, or be content with fewer by --least-scans"
        )
    middle = usable[len(usable) // 2]
    samples = [scan.sample for scan in found.scans]
    try:
        return fit(
            samples[:middle],
            samples[middle:],
            sorted({*P_FAS, settings.p_fa}, reverse=True),
            settings,
            name=name,
            provenance=_provenance(reads, found, len(usable)),
            **found.setting._asdict(),
        )
    except ValueError as error:
        raise GatewayError(f"these recordings give no calibration: {error}") from error


def displacement(found: Material, made: Calibration) -> str:
    """Where the stored terrain lies from where the radar sees it, on average; and what to check if that is far off."""
    model = cast(ShiftModel, made.shift)  # which no fit lacks
    shift = mean_shift([score(scan.sample, model.front, model.back) for scan in found.scans])
    bin_m = found.setting.range_nm * NM_M / found.setting.bins
    # Terrain that lies farther north than where the radar sees it has its shadows farther off there than the radar's.
    north, east = -bin_m * shift.bins
    errors = " and ".join(f"{error:.0f}" for error in bin_m * shift.stderr_bins)
    where = (
        f"{abs(north):.0f} m {'north' if north > 0 else 'south'} and {abs(east):.0f} m {'east' if east > 0 else 'west'}"
    )
    said = f"on average the stored terrain lies {where} of where the radar sees it (standard errors {errors} m)"
    if math.hypot(north, east) <= bin_m or shift.statistic <= shift_threshold(BY_CHANCE):
        return said
    return f"{said}: check its datum, the position's source and the lever arm, or this calibration hides that error"


def _provenance(reads: Sequence[Read], found: Material, usable: int) -> str:
    fitted = usable // 2
    recordings = ", ".join(
        f"{read.name} ({utc(read.begins_utc_ns or 0)}, SHA-256 {read.digest[:16]})" for read in reads if read.scans
    )
    settings = json.dumps(reads[0].settings.model_dump(mode="json", exclude_defaults=True))
    return shown(
        f"{fitted} scans fitted and {usable - fitted} checked, of {len(found.scans)} that were compared and "
        f"{found.left_out} of other radar settings; recordings {recordings}; reference terrain "
        f"{'; '.join(sorted({read.terrain for read in reads}))}; monitor settings "
        f"{settings} and defaults; shadebus {version('shadebus')}"
    )
