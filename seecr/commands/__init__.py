"""Commands to the winches, known loads, and the path between rows."""
