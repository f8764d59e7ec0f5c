"""What may be at work that is not in the catalogue."""
