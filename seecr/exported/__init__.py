"""A calibrated robot as MJCF, and the parts of its model that MJCF cannot express."""
