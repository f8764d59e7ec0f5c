"""What a robot with effects would read, how that changes with them, and how sure it is."""
