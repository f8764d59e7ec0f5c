"""What measurements would show, before they are made."""
