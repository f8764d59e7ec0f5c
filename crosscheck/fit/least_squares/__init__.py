"""Measurements as a least-squares problem: residuals, derivatives, and their linear algebra."""
