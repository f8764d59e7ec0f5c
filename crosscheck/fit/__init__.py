"""Fits effects to measurements, with residuals in units of noise, and judges the fits."""
