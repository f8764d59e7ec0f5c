"""SEECR compared with MuJoCo, pose by pose: what `crosscheck run` does."""
