"""Which effects a model is missing."""
