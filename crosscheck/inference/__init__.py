"""Infers from measurements which effects a model misses: one score, one search, one posterior."""
