"""What the monitor's numbers are worth, measured: `make evidence` writes docs/evidence.md.

`flown` flies, `faults` are what may be wrong, and each other module measures one thing and gives its part of the page.
"""
