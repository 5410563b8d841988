"""frictionid warm: machine code that the first run of a command would compile."""

from .progress import running


def warm() -> None:
    """Compile what commands run as machine code, once on a machine; the first run does it else."""
    from frictionid.api.warm import STEPS, warm_up

    with running([name for name, _ in STEPS], "compiling") as done:
        warm_up(done)
    print("compiled: the next run of a command begins at once")
