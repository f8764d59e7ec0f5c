"""Equilibria: how they are found, how they go along a trajectory, and how high passes are."""
