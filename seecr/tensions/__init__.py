"""Tensions within limits and rest lengths that hold a platform at a given pose."""
