"""The report: what the radar saw, what the terrain predicted, and how the two compare, as pictures and a page."""

import html
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Self

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from decoders.profiles import Profile
from gateway.console import clock, utc
from gateway.recording import Recording
from monitor.calibration import Calibration
from monitor.comparison import Comparison
from monitor.disparity import threshold
from monitor.geodesy import NM_M
from monitor.integrity import Monitor
from monitor.scans import Scan
from monitor.verdict import ALERT, OK, UNAVAILABLE, Verdict

VERDICT_COLOURS = {OK: "#2f8f4e", ALERT: "#c62828", UNAVAILABLE: "#b38600"}
LEGEND = [
    *(
        Line2D([], [], ls="", marker="o", color=VERDICT_COLOURS[name], label=f"largest test: {name}")
        for name in (OK, ALERT)
    ),
    Line2D([], [], ls="", marker="x", color="#8899aa", label="T as published"),
    Line2D([], [], lw=2, ls=":", color=VERDICT_COLOURS[UNAVAILABLE], label=UNAVAILABLE),
    Line2D([], [], lw=1, ls="--", color="k", label="limit"),
]


class Palette(NamedTuple):
    """The colours of a picture from the lowest value up, the values between which each lies, and what is explained."""

    colours: tuple[str, ...]
    bounds: tuple[float, ...]
    legend: dict[str, str]

    @classmethod
    def of_levels(cls, profile: Profile) -> Self:
        """The radar's own colours; of many levels eight are explained."""
        explained = np.linspace(0, len(profile.palette) - 1, NAMED_LEVELS).astype(int)
        legend = {profile.level_names[level]: profile.palette[level] for level in explained}
        return cls(profile.palette, tuple(level - 0.5 for level in range(len(profile.palette) + 1)), legend)


NAMED_LEVELS = 8
STATE_COLOURS = {"before the first lit bin": "#c9d1d9", "shadow": "#101418", "lit": "#2f8f4e"}
STATES = Palette(tuple(STATE_COLOURS.values()), (-4, -1, 0.5, 3), STATE_COLOURS)


@dataclass(frozen=True)
class Picture:
    """One scan as it was complete at a UTC in ns, with its verdict and the two threads behind it."""

    utc_ns: int
    scan: Scan
    verdict: Verdict
    comparison: Comparison | None


@dataclass(frozen=True)
class Flown:
    """A recording and its scans, the monitor that judged them, the radar, the UTC in ns of first and last record."""

    title: str
    recording: Recording
    monitor: Monitor
    profile: Profile
    began_ns: int
    ended_ns: int
    pictures: Sequence[Picture]


def write_report(directory: Path, legs: Sequence[Flown]) -> Path:
    """Write pictures and `index.html` into a directory; return the page's path."""
    directory.mkdir(parents=True, exist_ok=True)
    mpl.use("Agg")
    every_scan = "; ".join(f"{leg.title}: {_extent(leg)}" for leg in legs)
    parts = ["<!doctype html><meta charset=utf-8><title>shadebus report</title>", STYLE, "<h1>shadebus report</h1>"]
    parts += [_origins(legs), EXPLANATION]
    _save(_timeline(legs), directory / "statistic.png")
    parts.append("<h2>The tests against their limits</h2>")
    how = "Each dot is a scan, by that of its tests which comes nearest to its limit or farthest beyond: above the "
    how += "dashed line it alerts. A vertical line is a scan without the statistic."
    parts.append(_figure("statistic.png", "tests over their limits", f"{how} {every_scan}."))
    _save(_histogram(legs), directory / "disparities.png")
    parts.append("<h2>Disparities</h2>")
    parts.append(
        _figure(
            "disparities.png",
            "disparities",
            f"The disparities of all pairs of a leg, in steps of 3 bins, all beyond in the outermost. {every_scan}.",
        )
    )
    parts.append("<h2>The last scan of each leg</h2>")
    for number, leg in enumerate(legs):
        for picture in leg.pictures[-1:]:
            name = f"scan_{number}.png"
            _save(_ppi(leg, picture), directory / name)
            parts.append(_figure(name, _heading(leg.title, picture), _caption(leg.title, picture)))
    parts.append(_table(legs))
    page = directory / "index.html"
    page.write_text("\n".join(parts), encoding="utf-8")
    return page


STYLE = (
    "<style>body{font:15px sans-serif;max-width:1100px;margin:2em auto;padding:0 1em}img{max-width:100%}"
    "table{border-collapse:collapse}td,th{border:1px solid #ccc;padding:.2em .6em;text-align:right}"
    "td.text,#origins td,#origins th{text-align:left;overflow-wrap:anywhere}figure{margin:1em 0 2em}"
    "figcaption{color:#444}</style>"
)

EXPLANATION = """<h2>What the figures mean</h2>
<p>A shadow is a run of dark range bins behind high ground. On each radial used, a shadow that the radar sees is
paired with the one that the stored terrain predicts there; N<sub>D</sub> is the number of pairs in the scan. The
disparity D of a pair is the difference of the two centres, radar minus terrain, in range bins. T is the mean of
D<sup>2</sup>, as published. Q is the sum of the squares of D, each taken about its calibrated median and clipped,
over the calibrated variance; it has no unit. The threshold is what the statistic of the method (Q for robust,
N<sub>D</sub> T / sigma<sup>2</sup> for paper) exceeds with its part of the probability P<sub>FA</sub> in a scan in
which nothing is wrong: above it the verdict is <i>alert</i>. The mean is that of D: a terrain that lies too near or
too far on all radials moves it, a sideways shift need not. S is the shift statistic: whether the disparities follow
the cosine of the azimuth, as over terrain that is stored some way off. Unmatched is the share of shadows that have no
partner in the other thread: of the radar's, and of the terrain's. With the robust method and a calibration S and the
terrain's share, and by option the radar's, alert too, above limits of their own. <i>Unavailable</i> means that nothing
can be said, for the reason given; it is neither ok nor alert.</p>"""


def _extent(leg: Flown) -> str:
    if not leg.pictures:
        return "no scan"
    first, last = leg.pictures[0], leg.pictures[-1]
    counts = Counter(picture.verdict.verdict for picture in leg.pictures)
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    return f"scans {first.verdict.scan} to {last.verdict.scan}, {utc(first.utc_ns)} to {utc(last.utc_ns)}, {verdicts}"


def _caption(title: str, picture: Picture) -> str:
    scan, verdict, shape = picture.scan, picture.verdict, picture.scan.bins.shape
    bin_m = scan.range_nm * NM_M / shape[1]
    said = "; ".join((verdict.verdict, *verdict.reasons))
    return (
        f"{title}: scan {verdict.scan}, {utc(picture.utc_ns)}, verdict {said}. {shape[0]} radials of {shape[1]} "
        f"range bins of {bin_m:.1f} m."
    )


def _heading(title: str, picture: Picture) -> str:
    """Two lines: which scan, and its verdict."""
    v = picture.verdict
    why = f": {v.reasons[0]}" if v.verdict == UNAVAILABLE else ""
    return f"{title}, scan {v.scan}, {utc(picture.utc_ns)}\n{v.verdict}{why}"


def _figure(name: str, heading: str, caption: str) -> str:
    """A picture with what stands in it for those who cannot see it, and its caption."""
    image = f'<img src="{name}" alt="{html.escape(heading)}">'
    return f"<figure>{image}<figcaption>{html.escape(caption)}</figcaption></figure>"


def _origins(legs: Sequence[Flown]) -> str:
    """Where the figures come from, a row for each fact; what is the same for all legs is said once."""
    rows = ["<table id=origins><tr><th>leg" + "".join(f"<th>{html.escape(leg.title)}" for leg in legs)]
    for name, say in ORIGINS.items():
        said = [html.escape(say(leg)) for leg in legs]
        cells = f"<td colspan={len(said)}>{said[0]}" if len(set(said)) == 1 else "".join(f"<td>{text}" for text in said)
        rows.append(f"<tr><th>{name}{cells}")
    return "\n".join([*rows, "</table>"])


VERSIONS = ("shadebus", "numpy", "python")
ORIGINS: dict[str, Callable[[Flown], str]] = {
    "recording": lambda leg: leg.recording.path.name,
    "began": lambda leg: utc(leg.began_ns),
    "ended": lambda leg: utc(leg.ended_ns),
    "terrain": lambda leg: ", ".join(path.name for path in leg.monitor.terrain.paths),
    "terrain checksum": lambda leg: leg.monitor.terrain.checksum,
    "method": lambda leg: leg.monitor.settings.method,
    "P<sub>FA</sub> (per scan)": lambda leg: f"{leg.monitor.settings.p_fa:g}",
    "calibration": lambda leg: _calibration(leg.monitor.calibration),
    "versions": lambda leg: ", ".join(f"{name} {leg.recording.metadata[name]}" for name in VERSIONS),
}


def _calibration(calibration: Calibration | None) -> str:
    return f"{calibration.name}: {calibration.provenance}" if calibration else "none, so stated defaults"


def _save(figure: Figure, path: Path) -> None:
    figure.savefig(path, dpi=110, bbox_inches="tight")


def _ppi(leg: Flown, picture: Picture) -> Figure:
    """Radar levels, and beside them both threads if there was a comparison."""
    scan, compared = picture.scan, picture.comparison
    shown: list[tuple[str, NDArray[np.float64], NDArray[np.uint8] | NDArray[np.int8], Palette]]
    shown = [("radar levels", scan.scan_angle_deg, scan.bins, Palette.of_levels(leg.profile))]
    if compared:
        shown.append(("radar: lit and shadow", compared.scan_angle_deg, compared.radar_states, STATES))
        shown.append(("terrain: lit and shadow", compared.scan_angle_deg, compared.dem_states, STATES))
    figure = Figure(figsize=(5.2 * len(shown), 4))
    panels = figure.subplots(1, len(shown), subplot_kw={"projection": "polar"}, squeeze=False)[0]
    for panel, (name, angle_deg, values, palette) in zip(panels, shown, strict=True):
        _polar(panel, angle_deg, values, scan.range_nm / scan.bins.shape[1], palette)
        panel.set_title(f"{name} (range in NM)", y=0.9)
    figure.suptitle(_heading(leg.title, picture))
    return figure


def _polar(
    axes: Axes,
    angle_deg: NDArray[np.float64],
    values: NDArray[np.uint8] | NDArray[np.int8],
    width_nm: float,
    palette: Palette,
) -> None:
    order = np.argsort(angle_deg)
    angle = np.radians(angle_deg[order])
    edges = np.r_[1.5 * angle[0] - 0.5 * angle[1], (angle[1:] + angle[:-1]) / 2, 1.5 * angle[-1] - 0.5 * angle[-2]]
    ranges = np.arange(values.shape[1] + 1) * width_nm
    cmap, norm = ListedColormap(palette.colours), BoundaryNorm(palette.bounds, len(palette.colours))
    axes.pcolormesh(edges, ranges, values[order].T, cmap=cmap, norm=norm, rasterized=True)
    axes.set(theta_zero_location="N", theta_direction=-1, thetamin=-90, thetamax=90)
    axes.grid(visible=False)
    named = [Patch(facecolor=colour, edgecolor="#888888", label=name) for name, colour in palette.legend.items()]
    axes.legend(handles=named, loc="upper center", bbox_to_anchor=(0.5, 0.13), ncols=4, fontsize="small")


def _timeline(legs: Sequence[Flown]) -> Figure:
    figure = Figure(figsize=(11, 4.5))
    axes = figure.subplots(1, len(legs), sharey=True, squeeze=False)[0]
    for panel, leg in zip(axes, legs, strict=True):
        first_ns = leg.pictures[0].scan.time_ns[0] if leg.pictures else 0
        for picture in leg.pictures:
            time_s = (picture.scan.time_ns[-1] - first_ns) / 1e9
            v = picture.verdict
            colour = VERDICT_COLOURS[v.verdict]
            if v.q is None or v.threshold is None:
                panel.axvline(time_s, color=colour, lw=2, ls=":")
            else:
                panel.plot(time_s, _largest(v, leg.monitor.settings.method), "o", color=colour)
                t_threshold = threshold(v.n_pairs, leg.monitor.settings.p_fa)
                panel.plot(time_s, (v.t_normalised or 0) / t_threshold, "x", color="#8899aa")
        panel.axhline(1, color="k", lw=1, ls="--")
        panel.set(title=leg.title, xlabel="time since the first radial (s)")
    axes[0].set(ylabel="value over its limit", ylim=(0, 1.1 * max(axes[0].get_ylim()[1], 1)))
    figure.legend(handles=LEGEND, ncols=len(LEGEND), loc="outside upper center", fontsize="small")
    return figure


def _largest(v: Verdict, method: str) -> float:
    """Of all tests that decide, the largest value over its limit."""
    tests = (
        (v.q if method == "robust" else v.t_normalised, v.threshold),
        (v.shift, v.shift_limit),
        (v.unmatched_radar, v.unmatched_radar_limit),
        (v.unmatched_dem, v.unmatched_dem_limit),
    )
    return max(
        (value / max(limit, 1e-3) for value, limit in tests if value is not None and limit is not None), default=0.0
    )


def _histogram(legs: Sequence[Flown]) -> Figure:
    figure = Figure(figsize=(11, 3.8))
    axes = figure.subplots()
    edges = np.arange(-61.5, 62, 3)
    for leg in legs:
        found = [p.comparison.disparities for p in leg.pictures if p.comparison is not None]
        d = np.concatenate(found) if found else np.empty(0)
        inside = np.clip(d, edges[0], edges[-1])
        axes.hist(inside, edges.tolist(), histtype="step", lw=1.6, label=f"{leg.title} ({d.size} pairs)")
    axes.set(xlabel="disparity, radar minus terrain (range bins)", ylabel="pairs")
    axes.legend()
    return figure


HEADINGS = (
    "leg",
    "scan",
    "time (UTC)",
    "verdict",
    "N<sub>D</sub> (pairs)",
    "T (bins<sup>2</sup>)",
    "Q (no unit)",
    "threshold (no unit)",
    "mean (bins)",
    "S (no unit)",
    "limit of S (no unit)",
    "unmatched, radar (%)",
    "unmatched, terrain (%)",
    "reasons",
)


def _table(legs: Sequence[Flown]) -> str:
    rows = ["<h2>Verdicts</h2><table><tr>" + "".join(f"<th>{heading}" for heading in HEADINGS)]
    for leg in legs:
        for picture in leg.pictures:
            v = picture.verdict
            shares = (None if share is None else 100 * share for share in (v.unmatched_radar, v.unmatched_dem))
            figures = "".join(
                f"<td>{'' if x is None else format(x, '.1f')}"
                for x in (v.t_bins2, v.q, v.threshold, v.mean_bins, v.shift, v.shift_limit, *shares)
            )
            texts = (html.escape(leg.title), v.scan, clock(picture.utc_ns), v.verdict, v.n_pairs)
            reasons = html.escape("; ".join(v.reasons))
            rows.append("<tr>" + "".join(f"<td>{text}" for text in texts) + f"{figures}<td class=text>{reasons}")
    return "\n".join([*rows, "</table>"])
