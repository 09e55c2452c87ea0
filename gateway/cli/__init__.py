"""The command line: `shadebus VERB`. Each verb is one module, which imports what it needs when it runs."""

import sys

import typer

from gateway.cli.decode import decode_429, decode_708
from gateway.cli.demo import demo
from gateway.cli.doctor import doctor
from gateway.cli.dump import dump
from gateway.cli.info import info
from gateway.cli.replay import replay
from gateway.cli.run import run
from gateway.cli.simulate import simulate
from gateway.cli.thresholds import thresholds
from gateway.errors import GatewayError

app = typer.Typer(
    name="shadebus",
    help="Does the stored terrain agree with what the weather radar sees, and how sure are we?",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
for verb in (demo, run, simulate, replay, dump, info, thresholds, doctor):
    app.command()(verb)

decode = typer.Typer(help="Explain one bus word, field by field.", no_args_is_help=True)
decode.command("429")(decode_429)
decode.command("708")(decode_708)
app.add_typer(decode, name="decode")


def main() -> None:
    """Run the command line; an error that its user can mend is one line on stderr and exit code 1."""
    try:
        app()
    except GatewayError as error:
        print(f"shadebus: {error}", file=sys.stderr)
        sys.exit(1)
    except BrokenPipeError:  # the reader of our output has seen enough
        sys.stderr.close()
        sys.exit(1)
