"""A world and its instruments to byte-exact bus traffic."""
