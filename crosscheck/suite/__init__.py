"""SEECR held against MuJoCo, pose by pose: what `crosscheck run` does."""
