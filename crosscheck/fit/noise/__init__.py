"""What is noise: how large it is, whether residuals are nothing else, and rows far off."""
