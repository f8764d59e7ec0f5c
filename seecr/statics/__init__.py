"""The compiled loop on tables of a setup: where platforms rest, and how sure that is."""
