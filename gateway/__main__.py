"""`python -m gateway` is `shadebus`."""

from gateway.cli import main

main()
