"""`python -m gateway` is `shadebus`."""

import signal


def main() -> None:
    """Run the command line. Until a verb takes Ctrl-C itself it ends the process at once, imports included."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from gateway.cli import main as run  # noqa: PLC0415 # after the line above

    run()


if __name__ == "__main__":
    main()
