"""Whether this Python can run shadebus."""

import platform
import sys
from importlib import import_module

from gateway import kernel_cache
from gateway.doctor.finding import Finding

LIBRARIES = ("numba", "rasterio", "pyproj", "scipy", "mcap", "serial", "can", "usb", "libusb_package")


def python() -> Finding:
    """The version of Python."""
    good = (3, 11) <= sys.version_info < (3, 14)
    return Finding("Python", good, platform.python_version(), "use Python 3.11 to 3.13")


def libraries() -> Finding:
    """Whether the libraries load that bring others in C with them."""
    missing = []
    for name in LIBRARIES:
        try:
            import_module(name)
        except ImportError as error:
            missing.append(f"{name} ({error})")
    return Finding("libraries", not missing, ", ".join(missing) or f"{len(LIBRARIES)} load", "run `make setup` again")


def compiled_kernels() -> Finding:
    """Whether compiled kernels can be kept."""
    place = kernel_cache.place()
    return Finding("kernel cache", place is not None, str(place or "no directory can be written"), kernel_cache.MEND)
