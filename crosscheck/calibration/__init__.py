"""Fits all effects that the data can see at once, and finds out which of them are needed."""
