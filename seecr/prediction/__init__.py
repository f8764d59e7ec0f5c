"""Predicted readings of a robot with effects, their sensitivities and their uncertainty."""
