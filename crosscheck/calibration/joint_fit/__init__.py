"""Fits all effects that the data can see at once."""
