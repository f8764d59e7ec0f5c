"""Recordings for the Rerun viewer. Importing its modules imports Rerun: a second or two."""
