"""The robot as numbers: points, cables and joints, read from MJCF, and its fingerprint."""
