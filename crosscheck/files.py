"""Files as both packages read and write them; the names are :mod:`seecr.files`' own."""

from seecr.files import (
    Toml,
    check_replaces,
    check_writable,
    json_text,
    plain,
    read_text,
    read_toml,
    staged,
    write_text,
    write_texts,
    written,
)

__all__ = [
    "Toml",
    "check_replaces",
    "check_writable",
    "json_text",
    "plain",
    "read_text",
    "read_toml",
    "staged",
    "write_text",
    "write_texts",
    "written",
]
