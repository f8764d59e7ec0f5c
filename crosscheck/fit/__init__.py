"""Effects fitted to measurements: residuals in units of noise, fits, and what they are worth."""
