"""Measurements: rates of false and true alerts, and speed as ratios to a named rival."""
