"""Settings of the decoder tests."""

from hypothesis import settings

# The first example of a run may compile a kernel, so a time limit on an example would measure the compiler.
settings.register_profile("compiled", deadline=None)
settings.load_profile("compiled")
