"""Tables and shares as the page shows them."""

from collections.abc import Iterable, Sequence

from scipy.stats import binomtest


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; the first column to the left, numbers to the right."""
    lines = [headings, ["---", *("---:" for _ in headings[1:])], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def rate(count: int, total: int) -> str:
    """A rate with its exact (Clopper-Pearson) 95 % interval."""
    if not total:
        return "no scans"
    low, high = binomtest(count, total).proportion_ci(0.95)
    return f"{count / total:.4f} ({low:.4f} to {high:.4f})"


def share(count: int, total: int) -> str:
    """A share in percent, with what it is of."""
    return f"{100 * count / total:.0f} % of {total}" if total else "none"
