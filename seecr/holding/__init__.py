"""What holds a platform at a given pose: tensions within limits, and rest lengths."""
