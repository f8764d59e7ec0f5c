"""The noise of a joint fit: its size, its autocorrelation along runs, and rows that are far off."""
