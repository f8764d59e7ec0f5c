"""The columns of files of commands and measurements: one reader for both packages."""
