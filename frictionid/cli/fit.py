"""frictionid fit: friction of one data set, written as a model file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from frictionid.friction import Friction
    from frictionid.identifiers.formulation import Recipe
    from frictionid.shooting import Shooting


def fit(
    dataset: Annotated[Path, typer.Argument(help="Folder with dataset.toml, or that file.")],
    identifier: Annotated[str, typer.Option(help="Kind of identifier, e.g. stribeck.")],
    out: Annotated[Path, typer.Option(help="Model file to write.")],
    set_: Annotated[
        list[str] | None, typer.Option("--set", help="A setting, e.g. symmetric=false; repeatable.")
    ] = None,
    recipe: Annotated[str, typer.Option(help="Recipe: integral, or the study's.")] = "integral",
    data: Annotated[Path | None, typer.Option(help="Folder with the tables.")] = None,
    sample_time: Annotated[
        float | None, typer.Option(help="Use samples at least this far apart [s].")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the fit.")] = 0,
    by: Annotated[str | None, typer.Option(help="shooting: refine what the recipe finds.")] = None,
    free: Annotated[
        str, typer.Option(help="Blocks: friction,inertia,delay,gain,bias,offset,actuator.")
    ] = "friction",
    fixed: Annotated[
        list[str] | None,
        typer.Option(help="A parameter that stays, e.g. inertia.gravity_2; repeatable."),
    ] = None,
) -> None:
    """Fit friction to all recordings of a data set."""
    import numpy as np

    from frictionid.comparison import cross_validate as compare
    from frictionid.comparison.equations import equations
    from frictionid.comparison.registry import LAWS
    from frictionid.comparison.suite import identifier_named
    from frictionid.data.readers.dataset import load_dataset
    from frictionid.evaluation import Protocol, velocity_grid
    from frictionid.friction.model_files import save_model
    from frictionid.identifiers.formulation import training_problem
    from frictionid.shooting import Shooting, document_of, refine

    chosen = identifier_named(identifier, dict(map(_setting, set_ or [])))
    made = _recipe(recipe, by, free, fixed or [])
    compare.check_refinable(chosen, made)
    history = Protocol(sample_time=sample_time).history
    recordings = load_dataset(dataset, data)
    plant, step = compare.view_of(chosen, recordings, compare.first_step(made))
    problem = training_problem(recordings, plant, step, sample_time, history)
    everything = np.ones((1, len(problem.r)))
    friction = compare.fit(
        chosen, problem, everything, seed, plant.mechanism.description.angle_unit
    )[0]
    source: dict[str, Any] = {
        "dataset": recordings.name,
        "data": dict(recordings.hashes),
        "identifier": repr(chosen),
        "recipe": repr(made),
        "sample_time": sample_time,
        "seed": seed,
        **friction.provenance,  # what the identifier tells of its work; shooting begins anew
    }
    found = None
    if isinstance(made, Shooting):
        found = refine(friction, recordings, made.blocks, made.settings, sample_time=sample_time)
        friction = found.friction
        source["refined"] = document_of(found, recordings, velocity_grid(problem.nodes.inputs.w))
    source |= equations(friction, problem, everything[0], found)
    save_model(compare.with_provenance(friction, source), out, LAWS)
    _show(friction, source, out)


def _show(friction: Friction, source: Mapping[str, Any], out: Path) -> None:
    from frictionid.report import show_refined

    show_refined(source["refined"]) if "refined" in source else print(friction)
    if "equation" in source:
        print("\n  ".join(["with 95 % intervals:", *source["equation"]]))
    if "inclusion" in source:
        print("\n  ".join(["how often draws of the recordings had a term:", *source["inclusion"]]))
    print(f"written to {out}")


def _recipe(name: str, by: str | None, free: str, fixed: list[str]) -> Recipe | Shooting:
    """Recipe that the options name."""
    from frictionid.comparison.suite_recipes import RecipeEntry, recipe_named, shooting_of
    from frictionid.errors import InputError

    if by is None:
        if free != "friction" or fixed:
            raise InputError("--free and --fixed need --by shooting")
        return recipe_named(name)
    if by != "shooting":
        raise InputError(f"--by {by!r} is unknown; known is shooting")
    blocks = [part.strip() for part in free.split(",")]
    start = "integral" if name == "shooting" else name
    entry = RecipeEntry(name="shooting", by="shooting", free=blocks, fixed=fixed, start=start)
    return shooting_of(entry, "--by shooting")


def _setting(text: str) -> tuple[str, Any]:
    """Key and value of a setting, the value read as TOML where it is, else as text."""
    import tomllib

    from frictionid.errors import InputError

    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise InputError(f"--set {text!r} must be key=value, e.g. --set symmetric=false")
    try:
        read = tomllib.loads(f"x = {value}")
    # ValueError: no TOML, or an integer with thousands of digits
    except (ValueError, RecursionError):
        read = {}
    return key.strip(), read["x"] if set(read) == {"x"} else value
