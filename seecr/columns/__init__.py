"""What the columns of a file of commands and measurements mean: one reader for both packages."""
