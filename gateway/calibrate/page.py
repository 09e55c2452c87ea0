"""What a calibration found, as a page with its table and the histograms of residuals under the fitted normal."""

import html
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gateway.report import STYLE
from monitor.residuals import moments

PANELS_A_ROW = 3
SIGMAS_SHOWN = 4
FINEST_BINS = 0.5  # between two centres
BARS = 40  # about so many
PICTURE = "residuals.png"


class Histogram(NamedTuple):
    """Residuals of shadow centres (n,), range bins, and what they are of."""

    title: str
    values: NDArray[np.float64]


class Results(NamedTuple):
    """A calibration as a page tells it: its title, where it comes from, what its table means, and the table."""

    title: str
    provenance: str
    explanation: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    histograms: Sequence[Histogram]


def write_page(directory: Path, results: Results) -> Path:
    """Write the picture and `index.html` into a directory; return the page's path."""
    directory.mkdir(parents=True, exist_ok=True)
    _picture(results.histograms).savefig(directory / PICTURE, dpi=110, bbox_inches="tight")
    head = "".join(f"<th>{html.escape(heading)}" for heading in results.headings)
    rows = ("<tr>" + "".join(f"<td>{html.escape(cell)}" for cell in row) for row in results.rows)
    parts = [
        f"<!doctype html><meta charset=utf-8><title>{html.escape(results.title)}</title>{STYLE}",
        f"<h1>{html.escape(results.title)}</h1><p>{html.escape(results.provenance)}</p>",
        f"<p>{html.escape(results.explanation)}</p><table><tr>{head}",
        *rows,
        f'</table><figure><img src="{PICTURE}" alt="histograms of residuals"><figcaption>Residuals of shadow centres, '
        "and the normal of the same mean and sigma. What lies beyond is in the outermost bars.</figcaption></figure>",
    ]
    page = directory / "index.html"
    page.write_text("\n".join(parts), encoding="utf-8")
    return page


def _picture(histograms: Sequence[Histogram]) -> Figure:
    rows = -(-len(histograms) // PANELS_A_ROW)
    figure = Figure(figsize=(11, 3.4 * rows), layout="constrained")
    panels = figure.subplots(rows, PANELS_A_ROW, squeeze=False).ravel()
    for panel, histogram in zip(panels, histograms, strict=False):
        _panel(panel, histogram)
    for panel in panels[len(histograms) :]:
        panel.set_axis_off()
    return figure


def _panel(axes: Axes, histogram: Histogram) -> None:
    n, mean, sigma = moments(histogram.values)
    axes.set(title=f"{histogram.title}: {n}", xlabel="residual (range bins)", ylabel="shadows")
    if mean is None or not sigma:
        return
    step = FINEST_BINS * max(1, round(2 * SIGMAS_SHOWN * sigma / BARS / FINEST_BINS))
    bars = round(SIGMAS_SHOWN * sigma / step) + 1
    edges = step * (round(mean / step) + np.arange(2 * bars + 2) - bars - 0.5)
    axes.hist(np.clip(histogram.values, edges[0], edges[-1]), edges.tolist(), color="#8fb0d0")
    x = np.linspace(edges[0], edges[-1], 400)
    density = np.exp(-(((x - mean) / sigma) ** 2) / 2) / (sigma * np.sqrt(2 * np.pi))
    axes.plot(x, n * step * density, color="#c62828")
    axes.set_title(f"{histogram.title}: {n}\nmean {mean:.2f}, sigma {sigma:.2f}")
