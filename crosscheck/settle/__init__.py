"""MuJoCo brings a robot to rest: plain settling, then a polish."""
