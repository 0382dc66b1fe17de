"""Documents in strings and files."""

from __future__ import annotations

from pathlib import Path

from ._innovant import InnovantError


def document(source: str | Path) -> tuple[str, str]:
    """Name and text of a document, or of the file that it is in."""
    if isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("{"):
        return "document", source
    try:
        return str(source), Path(source).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InnovantError(f"{source}: cannot open: {error}; check the path and its permissions") from None


def written(text: str, path: str | Path | None) -> str:
    """The text of a document, which a file is given as well where there is a path."""
    if path is not None:
        Path(path).write_text(text, encoding="utf-8")
    return text
