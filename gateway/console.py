"""What a person at a terminal reads: one line an event."""

import sys
from collections.abc import Iterator
from datetime import UTC, datetime

from gateway.events import Event, IntegrityEvent, ScanEvent, StatusEvent, SummaryEvent


def print_json(event: Event) -> None:
    """One JSON line on stdout, at once."""
    sys.stdout.write(event.to_json() + "\n")
    sys.stdout.flush()


def print_line(event: Event) -> None:
    """One line on stdout for what a person wants to know; the aircraft's state is left to --json."""
    text = describe(event)
    if text:
        sys.stdout.write(f"{clock(event.time_ns)}  {text}\n")
        sys.stdout.flush()


def describe(event: Event) -> str:
    """A person's line for an event, or nothing."""
    if isinstance(event, StatusEvent):
        return f"{event.adapter}: {event.state}" + (f" ({event.reason})" if event.reason else "")
    if isinstance(event, ScanEvent):
        low, high = event.sector
        gaps = f", {event.gaps} missing" if event.gaps else ""
        gaps += f", {event.cut_off} cut off" if event.cut_off else ""
        return f"scan {event.scan}: {event.radials} radials{gaps}, {low:+.0f} to {high:+.0f} deg, {event.range_nm:g} NM"
    if isinstance(event, IntegrityEvent):
        return "  ".join((f"scan {event.scan}: {event.verdict.upper()}", *_figures(event), "; ".join(event.reasons)))
    if isinstance(event, SummaryEvent):
        return "summary: " + ", ".join(f"{name} {count}" for name, count in event.counters.items() if count)
    return ""


def _figures(event: IntegrityEvent) -> Iterator[str]:
    """Each test that there was, against what it may reach."""
    if event.q is not None and event.threshold is not None and event.t_bins2 is not None:
        decides = f"Q {event.q:.1f}" if event.method == "robust" else f"N T / sigma^2 {event.t_normalised:.1f}"
        yield f"N {event.n_pairs}  T {event.t_bins2:.1f} bins2  {decides} against {event.threshold:.1f}"
    if event.shift is not None and event.shift_limit is not None:
        yield f"S {event.shift:.1f} against {event.shift_limit:.1f}"
    if event.unmatched_dem is not None and event.unmatched_dem_limit is not None:
        yield f"unmatched {event.unmatched_dem:.0%} against {event.unmatched_dem_limit:.0%}"
    if event.offset_north_m is not None and event.offset_east_m is not None:
        place = f"{event.offset_north_m:+.0f} m north, {event.offset_east_m:+.0f} m east"
        yield f"off by {place} ({event.offset_confidence:.0%})"


def clock(time_ns: int) -> str:
    """UTC to the millisecond."""
    return datetime.fromtimestamp(time_ns / 1e9, UTC).strftime("%H:%M:%S.%f")[:-3]


def utc(time_ns: int) -> str:
    """UTC with its date, to the second."""
    return f"{datetime.fromtimestamp(time_ns / 1e9, UTC):%Y-%m-%d %H:%M:%S} UTC"
