"""Results for people: on the terminal, as pages, as recordings. Nothing is computed here."""
