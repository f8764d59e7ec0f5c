"""Batch calls on the compiled loop, and certified solutions."""
