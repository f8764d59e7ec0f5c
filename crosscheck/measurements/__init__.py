"""The CSV of a robot's measurements, the TOML beside it, and their content."""
