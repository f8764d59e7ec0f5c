"""Results for people and for files: rows, words, figures. Nothing is computed here."""
