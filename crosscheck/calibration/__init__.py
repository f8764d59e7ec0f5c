"""Every effect that the data can see, fitted at once, and which of them are needed."""
