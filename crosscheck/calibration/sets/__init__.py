"""Searches the sets of effects for those that explain the data best."""
