"""The command line: `shadebus VERB`. Each verb is one module, which imports what it needs when it runs."""

import os
import sys
from collections.abc import Callable
from io import TextIOWrapper

import typer

from gateway import kernel_cache
from gateway.cli.calibrate import calibrate_dem, calibrate_radar
from gateway.cli.cut import cut
from gateway.cli.decode import decode_429, decode_708
from gateway.cli.demo import demo
from gateway.cli.devices import devices
from gateway.cli.doctor import doctor
from gateway.cli.dump import dump
from gateway.cli.export import export
from gateway.cli.importing import import_
from gateway.cli.info import info
from gateway.cli.labels import labels
from gateway.cli.merge import merge
from gateway.cli.recover import recover
from gateway.cli.replay import replay
from gateway.cli.reprocess import reprocess
from gateway.cli.run import run
from gateway.cli.simulate import simulate
from gateway.cli.thresholds import thresholds
from gateway.cli.verify import verify
from gateway.errors import GatewayError
from gateway.names import shown

app = typer.Typer(
    name="shadebus",
    help="Does the stored terrain agree with what the weather radar sees, and how sure are we?",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
RECORDINGS = (replay, reprocess, dump, info, verify, recover, cut, merge, export)
for verb in (demo, run, simulate, *RECORDINGS, labels, thresholds, devices, doctor):
    app.command()(verb)
app.command("import")(import_)

decode = typer.Typer(help="Explain one bus word, field by field.", no_args_is_help=True)
decode.command("429")(decode_429)
decode.command("708")(decode_708)
app.add_typer(decode, name="decode")

calibrate = typer.Typer(help="Find how much disparity is normal.", no_args_is_help=True)
calibrate.command("radar")(calibrate_radar)
calibrate.command("dem")(calibrate_dem)
app.add_typer(calibrate, name="calibrate")


def main() -> None:
    """Run the command line; an error that its user can mend is one line on stderr and exit code 1."""
    if sys.stdout is None:  # and the next file to be opened would take its place
        sys.exit("shadebus: standard output is closed: send it to a file, a pipe or /dev/null")
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # as stderr: for names of files that are not UTF-8
    kernel_cache.choose()
    code, complaint = _end_of(app)
    flushed, unflushed = _end_of(sys.stdout.flush)
    if flushed:  # or Python tries again on its way out, and prints a traceback
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if complaint or unflushed:
        print(f"shadebus: {complaint or unflushed}", file=sys.stderr)
    sys.exit(code or flushed)


def _end_of(work: Callable[[], object]) -> tuple[int | str | None, str]:
    """The exit code of some work and, if that alone does not explain it, a sentence that does."""
    try:
        work()
    except SystemExit as end:
        return end.code, ""
    except GatewayError as error:
        return 1, str(error)
    except BrokenPipeError:  # the reader of our output has seen enough
        return 1, ""
    except OSError as error:
        return 1, f"{error.filename or 'standard output'}: {error.strerror or error}; choose another place for it"
    except (RuntimeError, UnicodeEncodeError) as error:
        if not (told := _told(error)):
            raise
        return 1, told
    return 0, ""


def _told(error: RuntimeError | UnicodeEncodeError) -> str:
    """What to say of an error from a library's depths, and nothing of a defect."""
    if isinstance(error, UnicodeEncodeError) and error.reason == "surrogates not allowed":
        return f"{shown(error.object)}: the name is not UTF-8, which what has to open it cannot take: rename it"
    if "no locator available" in str(error):
        return f"no directory takes the compiled kernels: {kernel_cache.MEND}"
    return ""
