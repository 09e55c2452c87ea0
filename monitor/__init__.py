"""Scans, aircraft state and terrain to verdicts: pure functions and small state objects."""
