"""The line protocol: every undamaged line is read, no damaged one is, however bytes come."""

import re

import numpy as np
from fixtures.mistakes import mistakes
from fixtures.refusals import assert_refused
from fixtures.tiny_pendulums import changed, write_toml
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from frictionid.rig.logfile import clock_runs, seconds, unified_time
from frictionid.rig.rig_settings import (
    MAX_LINE,
    LineProtocol,
    diagnosis,
    framed,
    load_rig_settings,
    parsed,
    unframed,
    written,
)

PLAIN, XOR, CRC = (LineProtocol(checksum=kind) for kind in ("none", "xor", "crc16"))
SAFE = LineProtocol(checksum="crc16", mark="$")
FORMATS = (
    PLAIN,
    LineProtocol(columns=["time"], checksum="xor"),
    LineProtocol(columns=["a", "time", "b", "c"], unit="ms", separator=";", mark="#"),
    SAFE,
)
numbers = st.one_of(
    st.integers(-(10**9), 10**12).map(str),
    st.floats(-1e6, 1e6).map(lambda v: f"{v:.6f}"),
    st.floats(-1e6, 1e6).map(lambda v: f"{round(v, 9):.3e}"),
)


@st.composite
def streams(draw, forms=st.sampled_from(FORMATS), mess=st.binary(max_size=30)):
    """A format, rows, and their lines with other bytes between them."""
    form = draw(forms)
    row = st.tuples(*[numbers] * len(form.columns))
    rows = draw(st.lists(row, max_size=12))
    stream = b"".join(draw(mess) + written(form, r) for r in rows)
    return form, [tuple(v.encode() for v in row) for row in rows], stream


def pieces(form, stream, cuts):
    """Rows of a stream that comes in pieces."""
    edges = [0, *sorted(c % (len(stream) + 1) for c in cuts), len(stream)]
    rest, rows = b"", []
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        found, _, rest = parsed(form, rest, stream[a:b])
        rows += found
    return rows


@given(streams(mess=st.just(b"")))
def test_what_was_written_is_read(case):
    form, rows, stream = case
    for end in (b"\n", b"\r\n"):
        assert parsed(form, b"", stream.replace(b"\n", end))[0] == rows


@given(streams(), st.lists(st.integers(0, 10**6), max_size=20))
def test_cuts_never_matter_whatever_comes(case, cuts):
    form, _, stream = case
    assert pieces(form, stream, cuts) == parsed(form, b"", stream)[0]


@given(streams(st.just(SAFE), st.binary(max_size=30)))
def test_with_a_mark_no_undamaged_line_is_lost_behind_garbage(case):
    form, rows, stream = case
    found = parsed(form, b"", stream)[0]
    # garbage may hold lines of its own; those that were sent come in order
    left = iter(found)
    assert all(row in left for row in rows)
    assert len(found) == len(rows)


@given(st.binary(max_size=200), st.sampled_from(FORMATS))
@example(b"1" * 3 * MAX_LINE + b",2,3\n", PLAIN)
@example(b"\xff\n$\n*\n,,\n", SAFE)
def test_garbage_never_breaks_anything(content, form):
    rows, _, left = parsed(form, b"", content)
    for row in rows:
        assert len(row) == len(form.columns)
        assert np.isfinite([float(cell) for cell in row]).all()
    assert len(left) <= MAX_LINE + 2
    unframed(form, content)


@given(st.tuples(*[numbers] * 3), st.integers(0, 10**6), st.sampled_from(["xor", "crc16"]))
def test_no_flipped_bit_passes_a_checksum(values, bit, kind):
    form = LineProtocol(checksum=kind)
    line = written(form, values)[:-1]
    assert parsed(form, b"", line.lower() + b"\n")[0] == parsed(form, b"", line + b"\n")[0]
    at, which = divmod(bit % (8 * len(line)), 8)
    broken = line[:at] + bytes([line[at] ^ (1 << which)]) + line[at + 1 :]
    same = broken.upper() == line.upper()  # a digit of the checksum in small letters
    assert not parsed(form, b"", broken + b"\n")[0] or same


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="$*")))
def test_commands_are_framed_and_read_again(text):
    assert unframed(SAFE, framed(SAFE, text)[:-1]) == (text or None)


FOREIGN = r"""
none \xfe\x81\x00\xf3\xfe\x81\x00\xf3 => nothing but garbage in 999 bytes: the baud rate
none 1,2,3,4      => their number of values is another: correct columns
none speed: 3     => lines such as 'speed: 3' do not follow
safe 1,2,3        => '1,2,3' do not follow the protocol '$time,command,current*crc16'
safe $1,2,3*0000  => their checksums are not crc16
crc16 1,2,3*2F    => correct [proto
"""


@mistakes(FOREIGN)
def test_a_foreign_protocol_is_reported_in_one_line(wrong, words):
    kind, _, line = wrong.encode().decode("unicode_escape").partition(" ")
    form = SAFE if kind == "safe" else LineProtocol(checksum=kind)
    text = diagnosis(form, parsed(form, b"", line.encode("latin-1") + b"\n")[1], 999)
    assert words in text
    assert "\n" not in text


MISTAKES = """
motor =                                     => [motor] is missing
motor = {gear = 3.0}                        => the key 'kt' is missing
motor.kt = 0.0                              => must not be zero
motor.kt = "1"                              => kt: it should be a valid number
motor.geer = 1.0                            => unknown key 'geer'; did you mean 'gear'?
motor.current = "amps"                      => names the column 'amps'
protocl = {}                                => unknown table [protocl]; did you mean 'protocol'?
protocol.send = "u"                         => must hold {value} once
protocol.columns = ["current"]              => have no 'time'
protocol.columns = ["time", "a", "a"]       => 'a' is named twice
protocol.columns = ["time", "host"]         => 'host' is no name
protocol.unit = "min"                       => unit: it should be 's', 'ms' or 'us'
protocol.checksum = "md5"                   => checksum: it should be 'none', 'xor' or 'crc16'
protocol.mark = "*"                         => mark = '*' must be one character
protocol.separator = ""                     => separator = '' must be one character
protocol.mark = ";"; protocol.separator = ";" => both ';'
protocol.wrap = 0.0                         => wrap: it should be greater than 0
"""


@mistakes(MISTAKES)
def test_a_rig_that_cannot_be_is_reported_in_one_line(wrong, words, tmp_path):
    document = changed({"motor": {"kt": 0.01, "gear": 20.0}}, wrong)
    with assert_refused("rig.toml: .*" + re.escape(words)):
        load_rig_settings(write_toml(tmp_path / "rig.toml", document))


# --- The controller's clock ---------------------------------------------------------------------


@given(st.integers(0, 10**15), st.sampled_from(["ms", "us"]))
def test_times_keep_their_last_digit(count, unit):
    digits = {"ms": 3, "us": 6}[unit]
    assert round(float(seconds(str(count), unit)) * 10**digits) == count or count > 2**52
    assert seconds(str(count), unit).replace(".", "").lstrip("0") == str(count).lstrip("0")


@given(st.integers(1, 60), st.floats(0.0, 4000.0), st.floats(0.01, 20.0))
def test_a_counter_that_begins_anew_is_unwound(count, start, step):
    wrap = 2.0**32 * 1e-6
    time = start + step * np.arange(count)
    clock, number, kept = clock_runs(time % wrap, 1e9 + time, wrap)
    assert kept.all()
    assert not number.any()
    assert_allclose(np.diff(clock), step, atol=1e-6)


@given(st.lists(st.integers(2, 30), min_size=1, max_size=4), st.integers(0, 10**6))
def test_restarts_are_separated_and_joined_by_the_hosts_clock(lengths, seed):
    generator = np.random.default_rng(seed)
    host, time, late, at = [], [], [], 1e9
    for k, length in enumerate(lengths):
        own = 0.5 + 100.0 * (len(lengths) - k) * (k == 0) + np.arange(length)
        delay = generator.uniform(0.0, 0.01, length)
        delay[generator.integers(length)] = 0.0
        host.append(at + np.arange(length) + delay)
        time.append(own)
        late.append(at + np.arange(length))
        at += length + 3.0
    host, time, late = (np.concatenate(x) for x in (host, time, late))
    runs = clock_runs(time, host, 2.0**32 * 1e-6)
    assert runs[1].max() == len(lengths) - 1
    joined, unsure = unified_time(runs, host)
    assert_allclose(joined - joined[0], late - late[0], atol=1e-6)
    assert 0.0 <= unsure <= 0.01


def test_a_damaged_time_and_a_repeated_one_are_left_out():
    time = np.array([1.0, 2.0, 9e9, 3.0, 3.0, 4.0])
    clock, number, kept = clock_runs(time, np.arange(6.0), 4294.0)
    assert clock[kept].tolist() == [1.0, 2.0, 3.0, 4.0]
    assert not number.any()
