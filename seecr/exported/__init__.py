"""A calibrated robot as MJCF, and what of its model MJCF cannot say."""
