"""Predicts what measurements would show before they are made."""
