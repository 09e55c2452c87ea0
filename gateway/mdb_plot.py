"""The minimum detectable bias against the number of pairs, as a picture."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from monitor.disparity import minimum_detectable_bias

FEWEST_SHOWN, MOST_SHOWN = 4, 200  # pairs; more if a configuration has more
POINTS = 100


class Configuration(NamedTuple):
    """A row of the paper's Table 2: pairs, sigma of a shadow centre in range bins, and the two probabilities."""

    n: int
    sigma_c_bins: float
    p_fa: float
    p_md: float

    def mdb_bins(self, n: float) -> float:
        """With so many pairs, range bins."""
        return minimum_detectable_bias(round(n), self.sigma_c_bins * 2**0.5, self.p_fa, self.p_md)


def plot_mdb(path: Path, configurations: Sequence[Configuration]) -> Figure:
    """Write a curve for each sigma_C, P_FA and P_MD, and a dot at each configuration's own N_D."""
    figure = Figure(figsize=(9, 5), layout="constrained")
    axes = figure.subplots()
    most = max(MOST_SHOWN, *(2 * c.n for c in configurations))
    pairs = np.unique(np.geomspace(FEWEST_SHOWN, most, POINTS).astype(int))
    for _, sigma, p_fa, p_md in dict.fromkeys(c._replace(n=0) for c in configurations):
        same = [c for c in configurations if c[1:] == (sigma, p_fa, p_md)]
        curve = [same[0].mdb_bins(n) for n in pairs]
        label = f"sigma_C {sigma:g} bins, P_FA {p_fa:.0e}, P_MD {p_md:.0e}"
        (line,) = axes.plot(pairs, curve, label=label)
        axes.plot([c.n for c in same], [c.mdb_bins(c.n) for c in same], "o", color=line.get_color())
    axes.set(xlabel="N_D (pairs)", ylabel="minimum detectable bias (range bins)", xscale="log", ylim=(0, None))
    axes.grid(visible=True, which="both", alpha=0.3)
    axes.legend()
    figure.savefig(path, format="png", dpi=110)  # whatever the name says
    return figure
