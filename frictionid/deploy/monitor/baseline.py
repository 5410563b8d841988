"""The baseline: how friction scatters between healthy recordings, as one JSON file."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import MAD, Array
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation import Prepared, training_of, with_calibration
from frictionid.files import json_text, read_bytes, read_json, sha256, write_json
from frictionid.fitting.one_step.recipe import INTEGRAL
from frictionid.friction import Friction, along
from frictionid.friction.model_files import model_document, read_model
from frictionid.mechanics import Mechanism

from .changes import Changes, Reference, recording_changes
from .effects import Effect, effects_of, total_weights
from .explanation import true_scatter

FORMAT = "frictionid baseline 3"
_SLOW = 0.1  # of the fast speed


@dataclass(frozen=True, repr=False)
class Baseline:
    """Healthy recordings of one machine.

    Attributes
    ----------
    mechanism : as of `machine_of`; joints : names of the n parts with friction
    reference : what changes are measured against
    names, hashes : of the N recordings
    changes : of the N recordings
    covariates : names of what friction may depend on, such as a temperature or a payload
    """

    mechanism: Mapping[str, Any]
    joints: tuple[str, ...]
    reference: Reference
    names: tuple[str, ...]
    hashes: tuple[str, ...]
    changes: Changes
    covariates: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"Baseline({len(self.names)} recordings of {', '.join(self.joints)})"

    @property
    def level(self) -> Array:
        """Friction (n,) of each part at its usual speed [N m]."""
        return self.reference.level

    @property
    def scatter(self) -> Array:
        """Standard deviation (n,) of friction at the usual speed between recordings, over it."""
        reference = self.reference
        weights = total_weights(reference.speeds)
        return true_scatter(self.changes, reference.effects, weights) / self.level


class Arrival(NamedTuple):
    """A recording that arrived: name, digest, its numbers, and the log evidence after it."""

    name: str
    digest: str
    changes: Changes
    log_evidence: float


def make_baseline(prepared: Prepared, friction: Friction) -> Baseline:
    """Baseline of healthy recordings about a fitted friction.

    Raises
    ------
    InputError
        Where there are fewer than two recordings.
    """
    dataset = prepared.dataset
    if len(dataset.recordings) < 2:
        raise InputError(
            f"data set {dataset.name!r}: a baseline needs two or more recordings, to see how "
            "friction scatters between them"
        )
    reference = reference_of(prepared, friction)
    names = _covariates(dataset)
    return Baseline(
        mechanism=machine_of(dataset.mechanism),
        joints=tuple(dataset.mechanism.friction_names),
        reference=reference,
        names=dataset.names,
        hashes=hashes_of(dataset),
        changes=recording_changes(prepared, reference, names)[0],
        covariates=names,
    )


def reference_of(prepared: Prepared, friction: Friction) -> Reference:
    """The reference with the speeds and the noise of the data."""
    fast = np.quantile(np.abs(prepared.speeds), [0.5, 0.95], axis=0)
    fast = np.maximum(fast, 1e-9)
    view = with_calibration(prepared, friction.calibration)
    problem = training_of(view, INTEGRAL)
    e = np.abs(problem.residual(along(friction, problem.nodes)))
    noise = np.array([MAD * np.median(row[row > 0]) if row.any() else 1.0 for row in e.T])
    grid = np.stack([_SLOW * fast[1], np.maximum(fast[0], _SLOW * fast[1]), fast[1]], axis=1)
    reference = Reference(friction, grid, noise, ())
    return reference._replace(effects=effects_of(prepared.dataset.mechanism, reference.level))


def machine_of(mechanism: Mechanism) -> dict[str, Any]:
    """The [mechanism] table as files have it, with the digest of a file in place of its path."""
    table = json.loads(json_text(mechanism.table))
    for name in {"urdf", "mjcf"} & {*table}:
        table[name] = sha256(read_bytes(Path(table[name])))
        table["joints"] = list(mechanism.joints)  # said or not
    return dict(table)


def _covariates(dataset: Dataset) -> tuple[str, ...]:
    """Columns that every recording has, and parameters (a payload) that one of them gives."""
    columns = [set(r.covariates) for r in dataset.recordings]
    parameters = [set(r.parameters) for r in dataset.recordings]
    return tuple(sorted(set.intersection(*columns) | set.union(*parameters)))


def hashes_of(dataset: Dataset) -> tuple[str, ...]:
    """A digest of each recording's samples."""
    samples = (
        (r.angle.time, r.angle.value, r.torque.time, r.torque.value) for r in dataset.recordings
    )
    contents = (b"".join(np.ascontiguousarray(x).tobytes() for x in each) for each in samples)
    return tuple(map(sha256, contents))


def save_baseline(baseline: Baseline, path: Path, settings: Mapping[str, Any]) -> None:
    """Write a baseline as a JSON file, as a whole or not at all; `settings` say how it was made."""
    b, reference = baseline, baseline.reference
    document = {
        "format": FORMAT,
        "settings": dict(settings),
        "mechanism": dict(b.mechanism),
        "joints": b.joints,
        "model": model_document(reference.friction),
        "speeds": reference.speeds,
        "noise": reference.noise,
        "effects": [effect._asdict() for effect in reference.effects],
        "covariates": b.covariates,
        "recordings": [
            {"name": name, "sha256": digest, **numbers_of(b.changes, i)}
            for i, (name, digest) in enumerate(zip(b.names, b.hashes, strict=True))
        ],
    }
    write_json(path, document)


def numbers_of(changes: Changes, i: int) -> dict[str, Any]:
    """Numbers of one recording, by their names."""
    return {name: values[i] for name, values in changes._asdict().items()}


def changes_of(rows: list[Mapping[str, Any]]) -> Changes:
    """Changes of recordings from their numbers by name."""
    columns = ([row[name] for row in rows] for name in Changes._fields)
    return Changes(*(np.array(column, dtype=float) for column in columns))


def load_baseline(path: Path) -> Baseline:
    """Baseline of a JSON file.

    Raises
    ------
    InputError
        Where it is no baseline, is damaged, or was made by another version.
    """
    document = read_json(path)
    if document.get("format") != FORMAT:
        raise InputError(
            f'{path}: "format" is {document.get("format")!r}, not "{FORMAT}": '
            "make the baseline again by frictionid baseline"
        )
    try:
        friction = read_model(document["model"], str(path))
        rows = document["recordings"]
        grid, noise = (np.array(document[name], dtype=float) for name in ("speeds", "noise"))
        baseline = Baseline(
            document["mechanism"],
            tuple(document["joints"]),
            Reference(
                friction,
                grid,
                noise,
                tuple(Effect(**effect) for effect in document["effects"]),
            ),
            tuple(row["name"] for row in rows),
            tuple(row["sha256"] for row in rows),
            changes_of(rows),
            tuple(document["covariates"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: is damaged ({error!r}): make the baseline again") from None
    shape = (len(baseline.names), len(baseline.reference.effects))
    if baseline.changes.value.shape != shape or len(baseline.names) < 2:
        raise InputError(f"{path}: is damaged: it needs numbers of {shape}: make it again")
    return baseline


def check_same_machine(baseline: Baseline, dataset: Dataset, where: str) -> None:
    """Check that recordings are of the machine of the baseline.

    Raises
    ------
    InputError
        Where joints or a parameter of the mechanism differ, or a recording has a payload of which
        the baseline knows nothing.
    """
    table, healthy = machine_of(dataset.mechanism), dict(baseline.mechanism)
    if tuple(dataset.mechanism.friction_names) != baseline.joints or table.get(
        "kind"
    ) != healthy.get("kind"):
        raise InputError(
            f"{where}: the baseline is of {healthy.get('kind', 'a robot')!r} with the joints "
            f"{', '.join(baseline.joints)}, this is {dataset.mechanism}: make a baseline of its own"
        )
    if table != healthy:
        differ = sorted(k for k in {*table, *healthy} if table.get(k) != healthy.get(k))
        raise InputError(
            f"{where}: the mechanism of the baseline differs in {', '.join(differ)}: make a "
            "baseline of this machine"
        )
    carried = dict(zip(baseline.covariates, baseline.changes.covariates.T, strict=True))
    for recording in dataset.recordings:
        for name, value in recording.parameters.items():
            usual = carried.get(name, [dataset.mechanism.defaults[name]])
            if np.ptp(usual) == 0 and value != usual[0]:
                raise InputError(
                    f"{where}, recording {recording.name!r}: {name} = {value:g} is not the "
                    f"baseline's {usual[0]:g}, and how friction depends on it is not known: "
                    f"make a baseline with healthy recordings of different {name}"
                )
