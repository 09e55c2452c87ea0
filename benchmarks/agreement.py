"""The terrain thread beside programs of others, on real terrain: `make agreement`.

It needs gdal-bin from the system's packages; minutes, most of them xarray-spatial's. Exits 1 if a claim fails.
"""

import sys

from benchmarks import blockage, geodesy, line_of_sight, viewshed_speed

SECTIONS = {
    "Shadows in line of sight": line_of_sight.section,
    "Its speed beside gdal_viewshed": viewshed_speed.section,
    "Places on the Earth": geodesy.section,
    "The beam and the ground": blockage.section,
}


def report() -> str:
    """All figures as Markdown. Leaves with a message if a program that is not a Python package is missing."""
    return "\n".join(
        line for title, section in SECTIONS.items() for line in ("", f"### {title}", "", *section())
    ).strip()


def main() -> None:
    """Print the report, and judge the claims."""
    text = report()
    print(text)
    sys.exit(1 if "FAILS" in text else 0)


if __name__ == "__main__":
    main()
