"""Schemes of control on a robot that may not be the one that the controller believes."""
