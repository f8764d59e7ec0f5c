"""Control in MuJoCo, with time: winches, vibrations, and a tracker that is late."""
