"""Results for people and for files: words, rows, figures, recordings. Nothing is computed here."""
