"""The one exception that tells the user what to change."""


class InputError(ValueError):
    r"""A mistake in what the user gave, on one line: rule, value, place and way out.

    The command line prints the message without a traceback and exits with status 2. It is raised
    where data come in (files, settings, constructors), never from inside the numerics.

    Examples
    --------
    >>> str(InputError("time must increase:\n row 3"))
    'time must increase: row 3'
    """

    def __init__(self, message: str) -> None:
        # Names of files and columns are the user's own text and may hold line breaks.
        super().__init__(" ".join(message.split()))
