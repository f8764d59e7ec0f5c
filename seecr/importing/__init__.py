"""Robots that are no MJCF: tables of points, and the files of CASPR and WireX."""
