"""Packed files, unpacked as far as a recording may be large: small files must not fill memory."""

import zlib

from frictionid.errors import InputError

SMALL, RATIO, LARGEST = 1 << 26, 100, 1 << 30  # [bytes], unpacked over packed, [bytes]
CELLS = 50_000_000  # of a table


def most_bytes(packed: int) -> int:
    """Largest size [bytes] that a packed file may unpack to: 64 MiB, or 100 times its own."""
    return min(max(SMALL, RATIO * packed), LARGEST)


def unzip(content: bytes, file: str) -> bytes:
    """Content of a file, unpacked where its name ends with .gz.

    Raises
    ------
    InputError
        Where it is damaged, or unpacks to more than a recording has.
    """
    if not file.lower().endswith(".gz"):
        return content
    most, parts, rest = most_bytes(len(content)), [], content
    try:
        while rest:  # a file may have several members
            stream = zlib.decompressobj(wbits=31)
            parts.append(stream.decompress(rest, most + 1))
            most -= len(parts[-1])
            if most < 0:
                size = most_bytes(len(content)) / 1e6
                raise InputError(
                    f"{file}: {len(content) / 1e6:.3g} MB unpack to over {size:.0f} MB: unpack "
                    "it yourself where that is right"
                )
            if not stream.eof:
                raise EOFError("it is cut off")
            rest = stream.unused_data.lstrip(b"\0")
    except (EOFError, zlib.error) as error:
        raise InputError(f"{file} is no whole gzip file ({error}); copy it again") from None
    return b"".join(parts)


def check_cells(rows: int, columns: int, file: str) -> None:
    """Check that a packed table is not larger than memory should be.

    Raises
    ------
    InputError
        Where it has more cells than `CELLS`.
    """
    if rows * columns > CELLS:
        raise InputError(
            f"{file}: {rows} rows of {columns} columns are more than {CELLS} numbers: cut it into "
            "several recordings"
        )
