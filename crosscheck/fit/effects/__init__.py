"""Fits effects to the data, from where to start to what the fit is worth."""
