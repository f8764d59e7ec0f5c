"""The robot: its points, cables and joints as numbers, from MJCF, and which robot it is."""
