"""File names as text that a recording, JSON and a terminal can hold."""


def shown(name: str) -> str:
    r"""A name, or a sentence with names in it; bytes that are not UTF-8, in Python surrogates, become `\xff`."""
    return name.encode(errors="surrogateescape").decode(errors="backslashreplace")
