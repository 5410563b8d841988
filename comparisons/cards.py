"""Cards of identified machines, in machines/: one model file each, to simulate them by.

    FRICTIONID_DATA=FOLDER python comparisons/cards.py [CARD ...]

Every card is made by the defaults, from public recordings:

- `quick`: laws on the same held-out recordings (or stretches of time), and the one that the rule
  of the verdict chooses, fitted to what was compared; of arms whose controller is in no log by
  inverse dynamics, judged by the torque that is left;
- a servo that follows targets: laws by shooting with its controller, fitted to every second log and
  judged on the others;
- a quadruped in the air: laws by shooting with its controller, fitted to the first two thirds and
  judged by a free run of the last one (see `go2.py`), then fitted to all;
- published models: as they stand, judged on our recordings. These may have been fitted to them.

Without names all cards are made that are not there, and all are run in MuJoCo. Prints their tables,
whose figures docs/machine_cards.md has, and draws its picture.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import go2
import numpy as np
from exported import halves
from script import call

import frictionid as fid
from frictionid.api.machines import HeldOut, Machine
from frictionid.data.joint_scales import norm_of
from frictionid.data.recordings import Dataset
from frictionid.deploy.export.exported import exported
from frictionid.deploy.export.formats.mujoco import physical_parameters
from frictionid.deploy.export.nearest import cost_of, cost_sentence, is_coulomb_viscous, nearest
from frictionid.errors import InputError
from frictionid.evaluation import score_value
from frictionid.files import shipped, shipped_names, write_json
from frictionid.friction import Friction
from frictionid.friction.laws import NoFriction
from frictionid.friction.model_files import load_model, model_document
from frictionid.quickstart.quick_report import verdict
from frictionid.report.figures.style import COLOURS, panel_grid, png

DATA = Path(__file__).parent.parent / "data"
PICTURE = DATA.parent / "docs" / "pictures" / "machine_cards.png"
AHEAD = 0.5  # [s]
SERVO_LAWS = ("coulomb_viscous", "stribeck", "motor_load")
LEG_LAWS = ("coulomb_viscous", "ripple")


class Card(NamedTuple):
    """A machine: its title, data set, and how the model comes about.

    file : of a published model, beside the data set
    """

    title: str
    dataset: str
    how: str = "quick"
    file: str = ""


CARDS = {
    "xl330": Card(
        "Dynamixel XL330-M288, a small servo; drive at firmware gain 100, kp in proportion",
        "bam_xl330_whole",
        "servo",
    ),
    "dfki_c1": Card("double pendulum C.1 of DFKI, two AK80-6 drives", "dfki_c1"),
    "dfki_a0": Card("double pendulum A.0 of DFKI, two AK80-6 drives", "dfki_a0"),
    "emps": Card("electro-mechanical positioning system, a motor on a carriage", "emps"),
    "simple_pendulum": Card("torque-limited pendulum of DFKI, direct drive", "simple_pendulum"),
    "tx40": Card("Staubli TX40, an arm of six joints", "tx40"),
    "go2": Card("Unitree Go2, twelve joints of a quadruped in the air", "go2", "legs"),
    "tiago": Card("PAL Robotics TIAGo, four joints of the arm", "tiago"),
    "xl330_m1": Card("Dynamixel XL330-M288, BAM's M1", "bam_xl330_whole", "published", "m1"),
    "xl330_m6": Card("Dynamixel XL330-M288, BAM's M6", "bam_xl330_whole", "published", "m6"),
}


def quick(dataset: Dataset) -> tuple[Friction, HeldOut, str]:
    """The law of the first verdict."""
    result = fid.quick(dataset, lambda step: print("  ", step, flush=True))
    assert result.chosen is not None and result.friction is not None
    (without,) = (c.error for c in result.candidates if not c.parameters)
    if np.isfinite(result.horizon):
        units = dataset.mechanism.position_units
        unit = norm_of(np.zeros((1, len(units))), units, dataset.scales.size)[1]
        what = f"median of predictions after {result.horizon:g} s, {result.folds} folds"
        held = HeldOut(result.chosen.error, without, unit, what)
    else:
        left = 100 * result.chosen.error, 100 * without
        held = HeldOut(*left, "%", f"of the torque is left, {result.folds} folds")
    friction = result.friction
    if result.refined is not None:
        friction = friction.noted({"refined": result.refined})
    return friction, held, " ".join(verdict(result)[:1] + verdict(result)[2:])


def servo(dataset: Dataset) -> tuple[Friction, HeldOut, str]:
    """The law that predicts best the logs that its fit has not seen, every second one."""
    laws, (first, last) = SERVO_LAWS, halves(replace(dataset, hashes={}))
    fits = {law: shot(first, law) for law in laws}
    errors = ahead({**fits, "none": without_friction(fits[laws[0]])}, last)
    best = min(laws, key=lambda law: errors[law])
    what = f"median of predictions after {AHEAD:g} s, every second log"
    held = HeldOut(errors[best], errors["none"], "rad", what)
    said = ", ".join(f"{law} {errors[law]:.3g} rad" for law in laws if law != best)
    return shot(dataset, best), held, f"{best} predicts best: {said}."


def legs(dataset: Dataset) -> tuple[Friction, HeldOut, str]:
    """The law whose free run of the last third is best, fitted to all."""
    train, test = go2.part(0, 2 / 3), go2.part(2 / 3, 1)
    fits = {law: go2.fitted(law, train) for law in LEG_LAWS}
    fits["none"] = fid.Fit(without_friction(fits[LEG_LAWS[0]].friction))
    errors = {
        law: 1e-3 * float(np.sqrt(np.square(go2.errors(fit, test)).mean()))
        for law, fit in fits.items()
    }
    best = min(LEG_LAWS, key=lambda law: errors[law])
    what = "root mean square of a free run of the last third, by joint"
    held = HeldOut(errors[best], errors["none"], "rad", what)
    said = ", ".join(f"{law} {errors[law]:.2g} rad" for law in LEG_LAWS if law != best)
    return go2.fitted(best, dataset).friction, held, f"{best} predicts best: {said}."


def shot(dataset: Dataset, law: str) -> Friction:
    """A law by shooting, with its controller; masses and lengths are known."""
    free = ["friction", "target_delay"]
    return fid.fit(dataset, law, method="shooting", free=free, sample_time=0.005).friction


def without_friction(friction: Friction) -> Friction:
    """The same machine without friction."""
    return replace(friction, law=NoFriction(), theta=np.zeros((friction.n, 0)), constraints=None)


def ahead(models: dict[str, Friction], dataset: Dataset) -> dict[str, float]:
    """Median errors after half a second."""
    scores = fid.evaluate(models, dataset, [AHEAD])
    each = {name: scores[scores.identifier == name] for name in models}
    return {n: score_value(frame, "rollout_angle", "median", AHEAD) for n, frame in each.items()}


def published(dataset: Dataset, file: Path) -> tuple[Friction, HeldOut, str]:
    """A published model, judged on our recordings."""
    friction = load_model(file)
    errors = ahead({"published": friction, "none": without_friction(friction)}, dataset)
    what = f"median of predictions after {AHEAD:g} s, of all"
    return friction, HeldOut(*errors.values(), "rad", what), "As published, not fitted here."


def made(name: str) -> dict[str, Any]:
    """The document of a card."""
    card = CARDS[name]
    dataset = fid.load_dataset(DATA / card.dataset)
    if card.how == "published":
        file = DATA / "bam_xl330" / f"{card.file}.json"
        friction, held, sentence = published(dataset, file)
    else:
        makers = {"quick": quick, "servo": servo, "legs": legs}
        friction, held, sentence = makers[card.how](dataset)
    mechanism, calibration = dataset.mechanism, friction.calibration
    described = mechanism.kind in ("urdf", "mjcf")
    values = {k: v for k, v in friction.parameters.items() if k in mechanism.nominal()}
    if calibration is not None and calibration.base is not None and not described:
        try:
            values |= physical_parameters(mechanism, calibration.base)
        except InputError as error:
            sentence += f" {error}"
    drive = exported(friction, data=dataset).drive
    machine = {
        "title": card.title,
        "published": card.how == "published",
        "joints": list(mechanism.friction_names),
        "mechanism": {} if described else mechanism.with_values(values).table,
        "drive": None if drive is None else drive._asdict(),
        "held_out": held._asdict(),
        "nearest": simplified(friction, dataset),
        "dataset": card.dataset,
        "recordings": [r.name for r in dataset.recordings],
        "seconds": round(sum(float(np.ptp(r.angle.time)) for r in dataset.recordings), 2),
        **{key: dataset.origin.get(key, "") for key in ("origin", "licence", "citation")},
        "verdict": sentence,
    }
    return {**model_document(small(friction)), "machine": machine}


def simplified(friction: Friction, dataset: Dataset) -> dict[str, Any] | None:
    """Coulomb and viscous friction nearest along the recordings, and what it costs there."""
    model = exported(friction, dataset.mechanism.friction_names, data=dataset)
    if is_coulomb_viscous(model.law):
        return None
    other = nearest(model)
    return {"theta": other.theta, "cost": cost_sentence(model, cost_of(model, other))}


def small(friction: Friction) -> Friction:
    """The friction with bands at a tenth of the velocities."""
    refined = friction.provenance.refined
    if refined is None or refined.bands is None:
        return friction
    bands = refined.bands
    arrays = {k: v[::10] for k, v in bands._asdict().items() if isinstance(v, np.ndarray)}
    return friction.noted({"refined": replace(refined, bands=bands._replace(**arrays))})


# --- Page ----------------------------------------------------------------------------------------


def judged() -> Iterator[Machine]:
    """The cards of which there are recordings, see `published_servos.py` for the others."""
    for card in map(fid.machine, shipped_names("machines")):
        if card.held_out is not None:
            yield card


def table() -> Iterator[str]:
    """The table of cards; docs/machine_cards.md has it without titles and licences."""
    yield "| card | machine | law | held out | without friction | of what | licence |"
    yield "| --- | --- | --- | ---: | ---: | --- | --- |"
    for card in judged():
        name, held = card.name, card.held_out
        law = card.fit.law + (", published" if card.published else "")
        sizes = (f"{x:.3g} {held.unit}" for x in (held.error, held.without))
        columns = (f"`{name}`", card.title, law, *sizes, held.what, card.licence)
        yield f"| {' | '.join(columns)} |"


def engine_table() -> Iterator[str]:
    """The table of cards in MuJoCo, as their files are, beside our predictions."""
    yield "| card | law | what MJCF cannot hold | mean | median | error in MuJoCo | ours |"
    yield "| --- | --- | --- | ---: | ---: | ---: | ---: |"
    with TemporaryDirectory() as folder:
        for card in judged():
            name = card.name
            if card.mechanism is None:
                continue
            done = fid.export(
                card, "mujoco", Path(folder) / f"{name}.xml", data=DATA / card.dataset
            )
            back = done.round_trip
            if back is not None:
                lost = card.fit.law if done.cost else ""
                sizes = (back.mean_apart, back.apart, back.held, back.model)
                numbers = " | ".join(f"{x:.2g} {back.unit}" for x in sizes)
                yield f"| `{name}` | {card.fit.law} | {lost} | {numbers} |"


def picture() -> Any:
    """Friction over velocity of all machines, joints together, with 95 % bands where known."""
    machines: dict[str, list[Machine]] = {}
    for card in map(fid.machine, shipped_names("machines")):
        machines.setdefault(card.name.partition("_m")[0], []).append(card)
    figure, panels = panel_grid(len(machines), 3, 2.2, 0.1)
    for axes, (name, alike) in zip(panels, machines.items(), strict=True):
        for k, card in enumerate(alike):
            for j, joint in enumerate(card.joints):
                model = card.name.removeprefix(name).strip("_") or "by the defaults"
                label = model if len(alike) > 1 else joint.removesuffix("_joint")
                draw(axes, card, j, j + k, label)
        units = alike[0].friction.position_units or ("rad",)
        axes.set_title(name, loc="left")
        axes.set_xlabel(f"velocity [{units[0]}/s]")
        axes.set_ylabel("friction [N m]" if units[0] == "rad" else "friction [N]")
        size, columns = (6, 1) if len(alike[0].joints) <= 7 else (4, 2)
        axes.legend(
            fontsize=size,
            ncols=columns,
            loc="upper left",
            labelspacing=0.2,
            handlelength=1.4,
            columnspacing=0.6,
        )
    return figure


def draw(axes: Any, card: Machine, joint: int, number: int, label: str) -> None:
    """One joint's curve and band, dashed where there are more curves than colours."""
    again, which = divmod(number, len(COLOURS))
    colour, style = COLOURS[which], "--" if again else "-"
    refined = card.friction.provenance.refined
    speed = (*card.friction.provenance.speeds, 6.0)[joint if card.friction.provenance.speeds else 0]
    w = np.linspace(-speed, speed, 201)
    curve = card.friction.curve(w)[:, joint]
    axes.plot(w, curve, style, color=colour, linewidth=1.2, label=label)
    if refined is not None and refined.bands is not None:
        v, middle, half = (
            np.asarray(x)[:, joint]
            for x in (refined.bands.velocity, refined.bands.curve, refined.bands.pointwise)
        )
        axes.fill_between(v, middle - half, middle + half, color=colour, alpha=0.2, linewidth=0)


def main(names: list[str] | None = None) -> None:
    """Make cards, those that are not there without names."""
    for name in names or [n for n in CARDS if not (shipped("machines") / f"{n}.json").exists()]:
        print(name, flush=True)
        write_json(shipped("machines") / f"{name}.json", made(name))
    print(*table(), sep="\n")
    if not names:
        print("", *engine_table(), sep="\n")
    PICTURE.write_bytes(png(picture))


if __name__ == "__main__":
    call(main)
