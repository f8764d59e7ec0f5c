"""Results as text for people; nothing is computed here."""
