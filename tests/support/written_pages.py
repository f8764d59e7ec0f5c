"""What a reader sees of a page: its text and its figures."""

from __future__ import annotations

import base64
import html
import re

_IMAGE = re.compile(r'<img [^>]*src="data:image/svg\+xml;base64,([^"]*)">')


def figures_of(markup: str) -> list[str]:
    """The SVG of each figure in a page or by itself."""
    return [base64.b64decode(image).decode() for image in _IMAGE.findall(markup)]


def text_of(markup: str) -> str:
    """What a reader sees, in the page and in its figures."""
    body = _IMAGE.sub(lambda image: base64.b64decode(image[1]).decode(), markup)
    body = re.sub(r"</?(a|b|button|code|small|span)\b[^>]*>", "", body)
    hidden = r"<(script|style|defs|details)\b.*?</\1>|<!--.*?-->"
    body = re.sub(hidden, "", body, flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", body)).split())
