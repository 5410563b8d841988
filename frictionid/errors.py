"""The one exception that tells the user what to change."""

from collections.abc import Iterator
from contextlib import contextmanager

_LONGEST = 1200  # characters of a message


class InputError(ValueError):
    r"""A mistake in what the user gave, on one line: rule, value, place and way out.

    The command line prints the message without a traceback and exits with status 2. It is raised
    where data come in (files, settings, constructors), and where a fit ends without a result.

    Examples
    --------
    >>> str(InputError("time must increase:\n row 3"))
    'time must increase: row 3'
    """

    def __init__(self, message: str) -> None:
        # Names of files and columns are the user's own text and may hold anything, at any length.
        text = printable(" ".join(message.split()))
        half = _LONGEST // 2
        super().__init__(text if len(text) <= _LONGEST else f"{text[:half]} [...] {text[-half:]}")


class NoFitError(InputError):
    """A model that cannot be fitted to data which others may well be fitted to."""


@contextmanager
def located(where: str) -> Iterator[None]:
    """What is wrong inside is said behind where it stands.

    >>> with located("suite.toml"):
    ...     raise InputError("two seeds are called '0'")
    Traceback (most recent call last):
        ...
    frictionid.errors.InputError: suite.toml: two seeds are called '0'
    """
    try:
        yield
    except InputError as error:
        kind = NoFitError if isinstance(error, NoFitError) else InputError
        raise kind(f"{where}: {error}") from None


@contextmanager
def needs(extra: str) -> Iterator[None]:
    """Imports of packages that an extra of frictionid installs; a missing one is an InputError.

    >>> with needs("export"):
    ...     import no_such_package
    Traceback (most recent call last):
        ...
    frictionid.errors.InputError: no_such_package is not installed: pip install 'frictionid[export]'
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if str(error.name).startswith("frictionid"):
            raise
        raise InputError(
            f"{error.name} is not installed: pip install 'frictionid[{extra}]'"
        ) from None


def printable(text: str) -> str:
    r"""The text with characters that steer a terminal written as escapes.

    >>> printable("\x1b[31mred\x1b[0m, 5 °C")
    '\\x1b[31mred\\x1b[0m, 5 °C'
    """
    shown = (c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)
    return "".join(shown)
