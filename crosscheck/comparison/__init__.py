"""Where a model is off: by coordinate, run, pose and region, and what the error goes with."""
