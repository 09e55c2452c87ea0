"""The report: what the radar saw, what the terrain predicted, and how the two compare, as pictures and a page."""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from monitor.disparity import threshold
from monitor.integrity import Comparison, Verdict
from monitor.scans import Scan

LIT, SHADOW, UNSEEN = "#2f8f4e", "#101418", "#c9d1d9"
VERDICT_COLOURS = {"ok": "#2f8f4e", "alert": "#c62828", "unavailable": "#b38600"}
LEGEND = [Line2D([], [], ls="", marker="o", color=c, label=f"Q: {name}") for name, c in VERDICT_COLOURS.items()]
LEGEND.append(Line2D([], [], ls="", marker="x", color="#8899aa", label="T as published"))
LEVELS = ListedColormap(["#101418", "#2f8f4e", "#d7c32d", "#c62828", "#b63bb6"])
STATES = ListedColormap([UNSEEN, SHADOW, LIT])


@dataclass(frozen=True)
class Picture:
    """One scan with its verdict and the two threads behind it."""

    scan: Scan
    verdict: Verdict
    comparison: Comparison | None


def write_report(directory: Path, legs: Mapping[str, Sequence[Picture]], p_fa: float) -> Path:
    """Write pictures and `index.html` into a directory; return the page's path. `p_fa` is that of the legs."""
    directory.mkdir(parents=True, exist_ok=True)
    mpl.use("Agg")
    parts = ["<!doctype html><meta charset=utf-8><title>shadebus report</title>", STYLE, "<h1>shadebus report</h1>"]
    _save(_timeline(legs, p_fa), directory / "statistic.png")
    _save(_histogram(legs), directory / "disparities.png")
    parts.append("<h2>The test statistic against its threshold</h2><img src=statistic.png>")
    parts.append(
        "<p>Each dot is a scan; above the dashed line it alerts. A vertical line is a scan without a verdict.</p>"
    )
    parts.append("<h2>Disparities</h2><img src=disparities.png>")
    for number, (title, pictures) in enumerate(legs.items()):
        shown = next((p for p in reversed(pictures) if p.comparison is not None), None)
        if shown is None or shown.comparison is None:
            continue
        name = f"scan_{number}.png"
        _save(_ppi(shown.scan, shown.comparison), directory / name)
        caption = f"{title}: scan {shown.verdict.scan}, {shown.verdict.verdict}"
        parts.append(f"<h2>{html.escape(caption)}</h2><img src={name}>")
        parts.append(
            "<p>Left: what the radar sent. Then lit bins green, shadows black, and grey before the first lit bin.</p>"
        )
    parts.append(_table(legs))
    page = directory / "index.html"
    page.write_text("\n".join(parts), encoding="utf-8")
    return page


STYLE = (
    "<style>body{font:15px sans-serif;max-width:1100px;margin:2em auto;padding:0 1em}img{max-width:100%}"
    "table{border-collapse:collapse}td,th{border:1px solid #ccc;padding:.2em .6em;text-align:right}</style>"
)


def _save(figure: Figure, path: Path) -> None:
    figure.savefig(path, dpi=110, bbox_inches="tight")


def _ppi(scan: Scan, comparison: Comparison) -> Figure:
    figure = Figure(figsize=(13, 3.4))
    panels = figure.subplots(1, 3, subplot_kw={"projection": "polar"})
    width_nm = scan.range_nm / scan.bins.shape[1]
    _polar(panels[0], scan.scan_angle_deg, scan.bins, width_nm, LEVELS, (0, 1, 2, 3, 4, 64))
    _polar(panels[1], comparison.scan_angle_deg, comparison.radar_states, width_nm, STATES, (-4, -1, 0.5, 3))
    _polar(panels[2], comparison.scan_angle_deg, comparison.dem_states, width_nm, STATES, (-4, -1, 0.5, 3))
    for axes, title in zip(panels, ("radar levels", "radar: lit and shadow", "terrain: lit and shadow"), strict=True):
        axes.set_title(f"{title} ({scan.range_nm:g} NM)")
    return figure


def _polar(
    axes: Axes,
    angle_deg: NDArray[np.float64],
    values: NDArray[np.uint8] | NDArray[np.int8],
    width_nm: float,
    colours: ListedColormap,
    bounds: Sequence[float],
) -> None:
    order = np.argsort(angle_deg)
    angle = np.radians(angle_deg[order])
    edges = np.r_[1.5 * angle[0] - 0.5 * angle[1], (angle[1:] + angle[:-1]) / 2, 1.5 * angle[-1] - 0.5 * angle[-2]]
    ranges = np.arange(values.shape[1] + 1) * width_nm
    norm = BoundaryNorm(bounds, colours.N)
    axes.pcolormesh(edges, ranges, values[order].T, cmap=colours, norm=norm, rasterized=True)
    axes.set(theta_zero_location="N", theta_direction=-1, thetamin=-90, thetamax=90)
    axes.grid(visible=False)


def _timeline(legs: Mapping[str, Sequence[Picture]], p_fa: float) -> Figure:
    figure = Figure(figsize=(11, 4.5))
    axes = figure.subplots(1, len(legs), sharey=True, squeeze=False)[0]
    for panel, (title, pictures) in zip(axes, legs.items(), strict=True):
        first_ns = pictures[0].scan.time_ns[0] if pictures else 0
        for picture in pictures:
            time_s = (picture.scan.time_ns[-1] - first_ns) / 1e9
            v = picture.verdict
            colour = VERDICT_COLOURS[v.verdict]
            if v.q is None or v.threshold is None:
                panel.axvline(time_s, color=colour, alpha=0.3)
            else:
                panel.plot(time_s, v.q / v.threshold, "o", color=colour)
                panel.plot(time_s, (v.t_normalised or 0) / threshold(v.n_pairs, p_fa), "x", color="#8899aa")
        panel.axhline(1, color="k", lw=1, ls="--")
        panel.set(title=title, xlabel="time (s)")
    axes[0].set(ylabel="statistic over its threshold", ylim=(0, 1.1 * max(axes[0].get_ylim()[1], 1)))
    axes[0].legend(handles=LEGEND, loc="upper left", fontsize="small")
    return figure


def _histogram(legs: Mapping[str, Sequence[Picture]]) -> Figure:
    figure = Figure(figsize=(11, 3.8))
    axes = figure.subplots()
    edges = np.arange(-60.5, 61.5, 3)
    for title, pictures in legs.items():
        found = [p.comparison.disparities for p in pictures if p.comparison is not None]
        d = np.concatenate(found) if found else np.empty(0)
        axes.hist(
            np.clip(d, edges[0], edges[-1]), edges.tolist(), histtype="step", lw=1.6, label=f"{title} ({d.size} pairs)"
        )
    axes.set(xlabel="disparity, radar minus terrain (range bins)", ylabel="pairs")
    axes.legend()
    return figure


def _table(legs: Mapping[str, Sequence[Picture]]) -> str:
    headings = ("leg", "scan", "verdict", "N", "T (bins<sup>2</sup>)", "Q", "threshold", "mean", "reasons")
    rows = ["<h2>Verdicts</h2><table><tr>" + "".join(f"<th>{heading}" for heading in headings)]
    for title, pictures in legs.items():
        for v in (picture.verdict for picture in pictures):
            figures = "".join(
                f"<td>{'' if x is None else format(x, '.1f')}" for x in (v.t_bins2, v.q, v.threshold, v.mean_bins)
            )
            reasons = html.escape("; ".join(v.reasons))
            rows.append(f"<tr><td>{html.escape(title)}<td>{v.scan}<td>{v.verdict}<td>{v.n_pairs}{figures}<td>{reasons}")
    return "\n".join([*rows, "</table>"])
