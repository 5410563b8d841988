"""Time and memory against the size of the data.

python comparisons/growth.py [--only check,fit] [--data recordings,one,short] [--largest 10]
                             [--limit 600] [--work FOLDER] [--out report/growth]

Each command runs in a process of its own, which may take `limit` seconds of processor time; its
time is that of the processor, its memory the most it held. Measured once; what has been measured
stays in growth.csv until it is measured again. Tables and pictures are of all that is there.
"""

from __future__ import annotations

import os
import resource
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import growth_data
import numpy as np
import pandas as pd
from script import call

from frictionid.report.figures.style import COLOURS, GREY, drawn, figure, rendered

FIT = (
    "fit",
    "{data}",
    "--out",
    "{out}/model.json",
    "--replace",
    "--by",
    "one_step",
    "--identifier",
)
COMMANDS: dict[str, tuple[str, ...]] = {
    "check": ("check", "{data}"),
    "fit": (*FIT, "stribeck"),
    "fit_memory": (*FIT, "film_lag"),
    "sindy": (*FIT, "sindy"),
    "mlp": (*FIT, "mlp"),
    "lstm": (*FIT, "lstm"),
    "shooting": (*FIT, "stribeck", "--by", "shooting"),
    "compare": ("compare", "{suite}", "--out", "{out}/report", "--jobs", "1", "--replace"),
}
SUITE = """name = "growth"
[folds]
count = 10
[[datasets]]
path = "{data}"
[[recipes]]
name = "integral"
[[identifiers]]
kind = "none"
[[identifiers]]
kind = "stribeck"
[[identifiers]]
kind = "sindy"
[[identifiers]]
kind = "mlp"
"""
START = "import sys; from frictionid.__main__ import main; sys.exit(main())"
KINDS = {"recordings": "-", "one": "--", "short": ":"}
NAMES = {
    "recordings": "recordings of 343 samples at 60 Hz",
    "one": "one recording at 1 kHz",
    "short": "recordings of 333 samples at 1 kHz",
}


def measured(command: str, folder: Path, limit: int) -> dict[str, Any]:
    """Processor time [s] and most memory [GB] of a command on a data set; how it ended."""
    with tempfile.TemporaryDirectory() as out:
        suite = Path(out) / "growth.toml"
        suite.write_text(SUITE.format(data=folder))
        words = [w.format(data=folder, out=out, suite=suite) for w in COMMANDS[command]]
        threads = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
        child = os.fork()
        if not child:
            _run([sys.executable, "-c", START, *words], limit, {**os.environ, **threads})
        _, status, usage = os.wait4(child, 0)
    code = os.waitstatus_to_exitcode(status)
    seconds = usage.ru_utime + usage.ru_stime
    over = code < 0 and seconds > 0.9 * limit
    # check says by 1 that it has something to say
    fine = code == 0 or command == "check" and code == 1
    ended = "ok" if fine else f"over {limit} s" if over else f"ended with {code}"
    return {"seconds": seconds, "memory_gb": usage.ru_maxrss / 2**20, "ended": ended}


def _run(words: list[str], limit: int, environment: dict[str, str]) -> None:
    """Become the command, which says nothing and ends at a limit of processor time."""
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))
    null = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(null, stream)
    os.execve(words[0], words, environment)


def exponents(table: pd.DataFrame) -> pd.Series:
    """By what power of the samples the time grew since the next smaller data set of its kind."""
    out = pd.Series(np.nan, table.index)
    for _, own in table[table.ended == "ok"].groupby(["command", "data"]):
        own = own.sort_values("samples")
        out[own.index[1:]] = np.diff(np.log(own.seconds)) / np.diff(np.log(own.samples))
    return out


def picture(table: pd.DataFrame) -> Any:
    """Time and memory over samples, both logarithmic, with lines of growth in proportion."""
    page = figure(3.6)
    panels = page.subplots(1, 2)
    fine = table[table.ended == "ok"]
    labels = (("seconds", "processor time [s]"), ("memory_gb", "most memory [GB]"))
    for axes, (column, label) in zip(panels, labels, strict=True):
        axes.set(xscale="log", yscale="log", xlabel="samples", ylabel=label)
        for (command, kind), own in fine.groupby(["command", "data"]):
            own = own.sort_values("samples")
            colour = COLOURS[list(COMMANDS).index(command) % len(COLOURS)]
            marker = "os"[list(COMMANDS).index(command) // len(COLOURS)]
            named = command if kind == "recordings" else None
            line = {"color": colour, "linestyle": KINDS[kind], "marker": marker, "markersize": 3}
            axes.plot(own.samples, own[column], label=named, **line)
        low, high = axes.get_ylim()
        ends = np.array([fine.samples.min(), fine.samples.max()])
        for scale in 10.0 ** np.arange(-9, 3):
            axes.plot(ends, scale * ends, color=GREY, linewidth=0.4, zorder=0)
        axes.set_ylim(low, high)
    if (fine.memory_gb > 0).any():
        panels[1].axhline(4.0, color=GREY, linestyle=(0, (1, 1)), linewidth=0.8)
    lines = [panels[0].plot([], [], color=GREY, linestyle=s)[0] for s in KINDS.values()]
    page.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper")
    page.legend(lines, list(NAMES.values()), loc="outside lower center", ncols=3)
    return page


def text(table: pd.DataFrame) -> str:
    """The table as Markdown."""
    lines = ["| data | samples | command | processor time [s] | memory [GB] | growth |"]
    lines.append("| --- | ---: | --- | ---: | ---: | ---: |")
    for row in table.itertuples():
        time = f"{row.seconds:.1f}" if row.ended == "ok" else row.ended
        power = "" if np.isnan(row.growth) else f"{row.growth:.2f}"
        lines.append(
            f"| {row.recordings} x {row.samples // row.recordings} | {row.samples:.3g} | "
            f"{row.command} | {time} | {row.memory_gb:.2f} | {power} |"
        )
    return "\n".join(lines) + "\n"


def write(table: pd.DataFrame, out: Path) -> None:
    """Table and picture."""
    out.mkdir(parents=True, exist_ok=True)
    kinds = pd.Categorical(table.data, list(KINDS)), pd.Categorical(table.command, list(COMMANDS))
    order = np.lexsort([table.samples, kinds[1].codes, kinds[0].codes])
    table = table.iloc[order].reset_index(drop=True)
    table["growth"] = exponents(table)
    table.round(4).to_csv(out / "growth.csv", index=False)
    (out / "growth.md").write_text(text(table))
    files = rendered(drawn(lambda: picture(table)), ("svg", "png"))
    for ending, content in files.items():
        (out / f"growth.{ending}").write_bytes(content)


def main(
    *,
    only: str = ",".join(COMMANDS),
    data: str = ",".join(KINDS),
    largest: int = 100,
    smallest: int = 1,
    limit: int = 1800,
    work: Path | None = None,
    out: Path = Path("report/growth"),
) -> None:
    """Measure what is asked for, and write it beside what has been measured before.

    Parameters
    ----------
    only : Commands.
    data : Kinds of data.
    largest : Times the smallest size.
    smallest : Times the smallest size.
    limit : Seconds of a command.
    work : Folder that keeps the data [a temporary one].
    out : Folder of table and picture.
    """
    place = work or Path(tempfile.mkdtemp())
    sizes = zip((1, 10, 100), growth_data.DEFAULT, growth_data.ONE, growth_data.MANY, strict=True)
    chosen = [each for times, *each in sizes if smallest <= times <= largest]
    try:
        for made in (made for each in chosen for made in each if made.kind in data.split(",")):
            folder = growth_data.make(made, place)
            for command in only.split(","):
                if made.kind == "short" and command == "compare":
                    continue  # a third of a second is too short for predictions
                row = {"data": made.kind, "recordings": made.count, "samples": made.total}
                row |= {"command": command, **measured(command, folder, limit)}
                print(row, flush=True)
                _add(row, out)
    finally:
        if work is None:
            shutil.rmtree(place)


def _add(row: dict[str, Any], out: Path) -> None:
    """Add a row in place of an earlier measurement of the same."""
    path, key = out / "growth.csv", ["data", "samples", "command"]
    table = pd.DataFrame([row])
    if path.exists():
        table = pd.concat([pd.read_csv(path), table])
    write(table.drop_duplicates(key, keep="last"), out)


if __name__ == "__main__":
    call(main)
