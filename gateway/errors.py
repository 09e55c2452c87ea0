"""Errors that a person can mend. Every message names the thing and the mend; the command line prints it and exits 1."""


class GatewayError(Exception):
    """Anything that stops the gateway for a reason its user can act on."""
