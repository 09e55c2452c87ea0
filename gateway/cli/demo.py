"""`shadebus demo`: the main job with nothing attached."""

from pathlib import Path
from typing import Annotated

import typer


def demo(
    out: Annotated[Path, typer.Option(help="directory for recordings and report")] = Path("demo"),
    seed: Annotated[int, typer.Option(min=0, help="another seed is another flight's noise")] = 7,
    speed: Annotated[float, typer.Option(min=0.1, max=10, help="times real bus rates")] = 4.0,
) -> None:
    """Fly three legs over real mountains on a real pseudo-terminal: true terrain, shifted terrain, failing GNSS.

    Ctrl-C ends it early with exit code 130, SIGTERM with 143.
    """
    from gateway.stopping import Stop

    stop = Stop()  # before the imports that take their time
    from gateway.demo import fly

    fly(out, seed, speed, stop)
