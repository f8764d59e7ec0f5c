"""The TOML file that keeps a robot's effects."""
