"""The one exception that tells the user what to change."""


class InputError(ValueError):
    """A mistake in what the user gave: one line with the rule, the value, its place and the way out.

    The command line prints the message without a traceback and exits with status 2. It is raised
    where data come in (files, settings, constructors), never from inside the numerics.
    """
