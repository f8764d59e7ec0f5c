"""Data that look wrong: of another robot, with columns exchanged, in another unit."""
