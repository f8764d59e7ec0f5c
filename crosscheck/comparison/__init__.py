"""Compares a model with measurements: its errors by coordinate, run, pose, region and cause."""
