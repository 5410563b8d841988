"""Time and memory against the size of the data, of a chain of joints, and of a law.

python comparisons/growth.py [--only check,fit] [--data recordings,one,short,joints,parameters]
                             [--largest 10] [--limit 600] [--work FOLDER] [--out report/growth]

Each command runs in a process of its own, which may take `limit` seconds of processor time; its
time is that of the processor, its memory the most it held. Measured once; what has been measured
stays in growth.csv until it is measured again. Tables and pictures are of all that is there.
"""

from __future__ import annotations

import json
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
from growth_data import Data
from script import call

from frictionid.report.figures.style import COLOURS, GREY, drawn, figure, rendered

FIT = "fit {data} --out {out}/model.json --replace --by "
ONE_STEP, SHOOTING = FIT + "one_step --identifier ", FIT + "shooting --identifier "
SPLINE, NETWORK = "spline --set knots={knots}", "mlp --set hidden={hidden}"
COMMANDS = {
    "check": "check {data}",
    "fit": ONE_STEP + "stribeck",
    "fit_memory": ONE_STEP + "film_lag",
    "sindy": ONE_STEP + "sindy",
    "mlp": ONE_STEP + "mlp",
    "lstm": ONE_STEP + "lstm",
    "shooting": SHOOTING + "stribeck",
    "inverse_dynamics": FIT + "inverse_dynamics --identifier stribeck",
    "spline": ONE_STEP + SPLINE,
    "network": ONE_STEP + NETWORK,
    "spline_shooting": SHOOTING + SPLINE,
    "network_shooting": SHOOTING + NETWORK,
    "compare": "compare {suite} --out {out}/report --jobs 1 --replace",
    "dynamics": "{data}",
}
USUAL = ("check", "fit", "fit_memory", "sindy", "mlp", "lstm", "shooting", "compare")
SUITED = {
    "short": USUAL[:-1],  # a third of a second is too short for predictions
    "joints": ("check", "fit", "inverse_dynamics", "shooting", "dynamics"),
    "parameters": ("spline", "network", "spline_shooting", "network_shooting"),
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
STATES = 1_000_000
DYNAMICS = f"""import sys; import numpy as np; import frictionid as fid
m = fid.load_dataset(sys.argv[1]).mechanism; rng = np.random.default_rng(0)
q, w = rng.normal(size=(2, 1000, m.n))
for _ in range({STATES} // 1000): m.dynamics(m.nominal_base, q, w)"""
KINDS = {"recordings": "-", "one": "--", "short": ":", "joints": "-", "parameters": "-"}
NAMES = {
    "recordings": "recordings of 343 samples at 60 Hz",
    "one": "one recording at 1 kHz",
    "short": "recordings of 333 samples at 1 kHz",
}
AXES = {"samples": tuple(NAMES), "joints": ("joints",), "parameters": ("parameters",)}


def measured(command: str, dataset: Data, folder: Path, limit: int) -> dict[str, Any]:
    """Processor time [s] and most memory [GB] of a command on a data set; how it ended."""
    with tempfile.TemporaryDirectory() as out:
        suite = Path(out) / "growth.toml"
        suite.write_text(SUITE.format(data=folder))
        at = {"data": folder, "out": out, "suite": suite, **_sizes(dataset.parameters)}
        words = [word.format(**at) for word in COMMANDS[command].split()]
        threads = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
        child = os.fork()
        if not child:
            program = DYNAMICS if command == "dynamics" else START
            _run([sys.executable, "-c", program, *words], limit, {**os.environ, **threads})
        _, status, usage = os.wait4(child, 0)
    code = os.waitstatus_to_exitcode(status)
    seconds = usage.ru_utime + usage.ru_stime
    over = code < 0 and seconds > 0.9 * limit
    # check says by 1 and 2 that it has something to say
    fine = code == 0 or command == "check" and code in (1, 2)
    ended = "ok" if fine else f"over {limit} s" if over else f"ended with {code}"
    return {"seconds": seconds, "memory_gb": usage.ru_maxrss / 2**20, "ended": ended}


def _sizes(parameters: int) -> dict[str, str]:
    """Settings of laws with about so many parameters of two joints: knots, and hidden units."""
    knots = np.geomspace(0.05, 15.0, max(parameters // 2 - 1, 2)).round(6).tolist()
    units = max(round((parameters / 2 + 2.25) ** 0.5 - 2.5), 1)  # a joint has u^2 + 5 u + 4
    return {"knots": json.dumps(knots, separators=",:"), "hidden": f"[{units},{units}]"}


def _run(words: list[str], limit: int, environment: dict[str, str]) -> None:
    """Become the command, which says nothing and ends at a limit of processor time."""
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))
    null = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(null, stream)
    os.execve(words[0], words, environment)


def exponents(table: pd.DataFrame) -> pd.Series:
    """By what power of its size the time grew since the next smaller data set of its kind."""
    out = pd.Series(np.nan, table.index)
    for _, own in table[table.ended == "ok"].groupby(["command", "data"]):
        own = own.sort_values("size")
        out[own.index[1:]] = np.diff(np.log(own.seconds)) / np.diff(np.log(own["size"]))
    return out


def picture(table: pd.DataFrame) -> Any:
    """Time and memory over what grows, logarithmic, with lines of growth in proportion."""
    fine = table[table.ended == "ok"]
    shown = [(label, fine[fine.data.isin(kinds)]) for label, kinds in AXES.items()]
    shown = [(label, own) for label, own in shown if len(own)]
    page = figure(3.0 * len(shown) + 0.6)
    for (label, own), (left, right) in zip(
        shown, page.subplots(len(shown), 2, squeeze=False), strict=True
    ):
        _curves(left, own, "seconds", label, "processor time [s]")
        _curves(right, own, "memory_gb", label, "most memory [GB]")
        right.axhline(4.0, color=GREY, linestyle=(0, (1, 1)), linewidth=0.8)
        if left.get_legend_handles_labels()[0]:
            left.legend()
    lines = [page.axes[0].plot([], [], color=GREY, linestyle=KINDS[kind])[0] for kind in NAMES]
    page.legend(lines, list(NAMES.values()), loc="outside lower center", ncols=3)
    return page


def _curves(axes: Any, table: pd.DataFrame, column: str, size: str, label: str) -> None:
    axes.set(xscale="log", yscale="log", xlabel=size, ylabel=label)
    for (command, kind), own in table.groupby(["command", "data"]):
        own, place = own.sort_values("size"), list(COMMANDS).index(command)
        line = {"color": COLOURS[place % len(COLOURS)], "marker": "os^"[place // len(COLOURS)]}
        named = command if kind not in ("one", "short") else None
        axes.plot(
            own["size"], own[column], label=named, linestyle=KINDS[kind], markersize=3, **line
        )
    low, high = axes.get_ylim()
    ends = np.array([table["size"].min(), table["size"].max()])
    for scale in 10.0 ** np.arange(-9, 3):
        axes.plot(ends, scale * ends, color=GREY, linewidth=0.4, zorder=0)
    axes.set_ylim(low, high)


def text(table: pd.DataFrame) -> str:
    """The table as Markdown."""
    lines = ["| data | size | command | processor time [s] | memory [GB] | growth |"]
    lines.append("| --- | ---: | --- | ---: | ---: | ---: |")
    for row in table.itertuples():
        time = f"{row.seconds:.1f}" if row.ended == "ok" else row.ended
        power = "" if np.isnan(row.growth) else f"{row.growth:.2f}"
        lines.append(
            f"| {row.data}: {row.recordings} x {row.samples // row.recordings} | {row.size:.3g} | "
            f"{row.command} | {time} | {row.memory_gb:.2f} | {power} |"
        )
    return "\n".join(lines) + "\n"


def write(table: pd.DataFrame, out: Path) -> None:
    """Table and picture."""
    out.mkdir(parents=True, exist_ok=True)
    kinds = pd.Categorical(table.data, list(KINDS)), pd.Categorical(table.command, list(COMMANDS))
    order = np.lexsort([table["size"], kinds[1].codes, kinds[0].codes])
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
    largest: int = 1000,
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
    wanted = [dataset for kind in growth_data.ALL for dataset in kind]
    wanted = [dataset for dataset in wanted if dataset.kind in data.split(",")]
    first = {dataset.kind: dataset.size for dataset in reversed(wanted)}
    try:
        for dataset in sorted(wanted, key=lambda dataset: dataset.size / first[dataset.kind]):
            if not smallest <= dataset.size / first[dataset.kind] <= largest:
                continue
            folder = growth_data.make(dataset, place)
            suited = SUITED.get(dataset.kind, USUAL)
            for command in (name for name in only.split(",") if name in suited):
                row = {"data": dataset.kind, "recordings": dataset.count, "samples": dataset.total}
                row |= {"size": dataset.size, "command": command}
                row |= measured(command, dataset, folder, limit)
                print(row, flush=True)
                _add(row, out)
    finally:
        if work is None:
            shutil.rmtree(place)


def _add(row: dict[str, Any], out: Path) -> None:
    """Add a row in place of an earlier measurement of the same."""
    path, key = out / "growth.csv", ["data", "size", "command"]
    table = pd.DataFrame([row])
    if path.exists():
        table = pd.concat([pd.read_csv(path), table])
    write(table.drop_duplicates(key, keep="last"), out)


if __name__ == "__main__":
    call(main)
