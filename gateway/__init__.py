"""Bytes in, bytes kept, answers out: the only package with input, output, threads and clocks."""
