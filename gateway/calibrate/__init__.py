"""Calibration: how much disparity is normal, from recordings and by Monte Carlo.

`recorded` reads one recording; `radar` makes the file that the monitor loads from many; `dem` runs the Monte Carlo of
the terrain thread; `page` draws what came out.
"""
