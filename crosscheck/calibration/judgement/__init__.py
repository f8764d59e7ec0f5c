"""How probable each effect is, and what may be said of it."""
