"""What the winches were told, the loads that were carried, and the way from row to row."""
