"""Diagnoses which effects a model is missing."""
