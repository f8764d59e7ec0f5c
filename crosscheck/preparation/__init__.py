"""Prepares measurements for a fit: which rows count, and what is fitted before anything else."""
