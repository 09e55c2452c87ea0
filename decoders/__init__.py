"""ARINC 429 and 708 words, and the link that carries them, to engineering values: pure functions on arrays."""
