"""Fit of friction, and whatever else the blocks free, to the balance of torques."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from frictionid.arrays import Array, rms
from frictionid.data.plants import Calibration
from frictionid.data.recordings import Dataset
from frictionid.dynamics.law_derivatives import reads_of
from frictionid.errors import InputError, NoFitError
from frictionid.friction import Friction, Inputs, Law, along, constraints_of
from frictionid.friction.coordinates import is_coupled_by_load, with_units_of
from frictionid.friction.laws import NoFriction
from frictionid.friction.provenance import Dropped, Estimates

from ..covariance import least_significant
from ..fit import UNEXPLAINED, Covariance, Fit
from ..identifier import Identifier
from ..neutral import (
    LocalCost,
    Unknown,
    at_neutral,
    at_neutral_bound,
    followed,
    freed,
    holding_unknown,
    sentences_of,
    with_held,
)
from ..one_step.recipe import checked_fit
from ..one_step.residual import data_range
from ..parameter_block import (
    Estimate,
    ParameterBlock,
    free_blocks,
    have_prior,
    values_of,
    with_excess,
    with_values,
)
from ..parameters import InertiaBlock, on_support
from ..sandwich import excess_of
from .solve import (
    TorqueProblem,
    TorqueSettings,
    TorqueSolution,
    groups_of,
    left_to_friction,
    logged_gain,
    made_consistent,
    normal_equations,
    solve,
    squares_like,
)
from .torque_balance import TorqueBalance

BLOCKS = ("friction", "inertia", "delay", "gain", "bias")
_STARTS = 2
_UNEXPLAINED = 0.5  # of a joint's torque, root mean square
_PINNED = 0.25  # a gain counts whose 95 % interval is narrower, to either side


def fit_torques(
    identifier: Identifier,
    balance: TorqueBalance,
    blocks: Sequence[ParameterBlock],
    settings: TorqueSettings,
    use: Array | None = None,
    seed: int = 0,
) -> Fit:
    """An identifier's friction, and the calibration, that explain the torques best.

    Friction is fitted for the nominal calibration, then all together. Wrong inertias may lead a law
    into a wrong valley: friction is fitted once more for the calibration found, with the loads that
    follow from it, all together again, and the better of both counts. Blocks of sensors that show
    nothing are left out, see `least_significant`.

    use : (K,) true for the windows that may be used, all by default

    Raises
    ------
    InputError
        For blocks that the torques do not show, and friction of joints that never slide.
    """
    use = np.ones(len(balance.start), dtype=bool) if use is None else use
    balance = balance.resolving(use)
    estimate = _nominal(balance)
    start = _friction(identifier, balance, estimate, seed)
    if start.law.is_network:
        raise InputError(f"{identifier!r}: networks are fitted by one-step recipes and by shooting")
    check_blocks(blocks, _with(estimate, start, balance), balance)
    blocks, every = tuple(blocks), {b.name: b for b in blocks}
    dropped: list[Dropped] = []
    free = _with_inertia(blocks, definite=False)
    best, law = _best(identifier, balance, start, free, settings, seed)
    while True:
        solution = _definite(_at_neutral(_weighted(best)))
        if settings.consistent:
            solution = made_consistent(solution)
        result = _result(solution, law, {d: every[d.block] for d in dropped})
        check_gains(result, balance.dataset)
        idle = least_significant(result.covariance, blocks, settings.significance)
        if idle is None:
            return result
        dropped.append(idle)
        blocks = tuple(b for b in blocks if b.name != idle.block)
        best = _without(best, idle.block)


def _without(solution: TorqueSolution, block: str) -> TorqueSolution:
    """The fit with a block left out, from where it ended with it."""
    problem, values = solution.problem, values_of(solution.estimate, solution.problem.blocks)
    idle = next(b for b in problem.blocks if b.block.name == block)
    values[idle.columns] = idle.block.values(_nominal(problem.balance), idle.parameters)
    estimate = with_values(solution.estimate, problem.blocks, values)
    blocks = tuple(b for b in solution.blocks if b.name != block)
    return solve(_problem(_with_loads(problem, estimate), blocks, estimate))


def _with_loads(problem: TorqueProblem, estimate: Estimate) -> TorqueProblem:
    """The problem with the loads of an estimate's bodies, where friction follows them."""
    if not is_coupled_by_load(estimate.mechanism, estimate.friction.law):
        return problem
    loaded = problem.balance.with_loads(np.asarray(estimate.calibration.base))
    return replace(problem, balance=loaded)


def _with_inertia(
    blocks: Sequence[ParameterBlock], *, definite: bool
) -> tuple[ParameterBlock, ...]:
    """The blocks, with base parameters whose M(q) stays positive definite, or any."""
    return tuple(
        replace(b, definite=definite) if isinstance(b, InertiaBlock) else b for b in blocks
    )


def _definite(solution: TorqueSolution) -> TorqueSolution:
    """The fit with M(q) positive definite, fitted once more where it is not."""
    blocks = _with_inertia(solution.blocks, definite=True)
    problem = _problem(solution.problem, blocks, solution.estimate)
    values = values_of(problem.at(problem.x), problem.blocks)
    if np.array_equal(values, values_of(solution.estimate, problem.blocks)):
        return solution._replace(problem=problem)
    return solve(problem)._replace(held=solution.held)


def _best(
    identifier: Identifier,
    balance: TorqueBalance,
    friction: Friction,
    blocks: Sequence[ParameterBlock],
    settings: TorqueSettings,
    seed: int,
) -> tuple[TorqueSolution, Law]:
    """The better fit of two starts: friction for the nominal calibration, and for that found so.

    With its law: an identifier that chooses terms does so in each.
    """
    estimate, ended = _nominal(balance), []
    problem = TorqueProblem(balance, (), estimate, settings)
    for turn in range(_STARTS):
        if turn:
            problem = _with_loads(problem, estimate)
            friction = _friction(identifier, problem.balance, estimate, seed)
        estimate = _with(estimate, friction, problem.balance)
        solution = solve(_problem(problem, on_support(blocks, friction), estimate))
        estimate = solution.estimate
        ended.append((solution, friction.law))
    # of the least product of the joints' noise
    return min(ended, key=lambda end: float(np.log(np.maximum(end[0].sigma, 1e-300)).sum()))


def _problem(
    before: TorqueProblem, blocks: Sequence[ParameterBlock], estimate: Estimate
) -> TorqueProblem:
    """A problem that begins at an estimate, its priors about the nominal calibration."""
    nominal = estimate._replace(calibration=_nominal(before.balance).calibration)
    return replace(before, blocks=free_blocks(blocks, nominal), estimate=estimate)


def _nominal(balance: TorqueBalance) -> Estimate:
    """The nominal calibration, without friction."""
    mechanism = balance.dataset.mechanism
    calibration = Calibration.ideal(mechanism.n, mechanism.nominal_base)
    none = Friction(NoFriction(), np.zeros((len(mechanism.friction_names), 0)))
    return Estimate(none, calibration, mechanism)


def _friction(
    identifier: Identifier, balance: TorqueBalance, estimate: Estimate, seed: int
) -> Friction:
    """The identifier's friction (n, P) for the calibration of an estimate."""
    problem = balance.sliding_problem(left_to_friction(balance, estimate))
    friction = checked_fit(identifier, problem, balance.use[None] * 1.0, seed)[0]
    return with_units_of(estimate.mechanism, friction)


def _with(estimate: Estimate, friction: Friction, balance: TorqueBalance) -> Estimate:
    """The estimate with another friction: sharp, and within what the data resolve."""
    limits = friction.constraints
    if limits is None:
        usual = data_range(balance.problem, balance.use[None] * 1.0)
        limits = constraints_of(friction.law, usual).at(0)
    if limits.equal:
        raise InputError(
            "equal joints: inverse dynamics gives each joint parameters of its own: fit by "
            "shooting, or in one step"
        )
    sharp = replace(friction, law=friction.law.sharpened(), constraints=limits, calibration=None)
    return estimate._replace(friction=sharp)


def _result(solution: TorqueSolution, law: Law, dropped: Mapping[Dropped, ParameterBlock]) -> Fit:
    """The result of a fit by a law, without what was dropped or held."""
    estimate = solution.estimate
    calibration = estimate.calibration
    friction = replace(
        estimate.friction, law=law, parameters={}, constraints=None, calibration=calibration
    )
    return Fit(
        friction,
        _with_held(_local_cost(solution).covariance, solution, tuple(dropped.values())),
        Estimates(
            torque_noise=solution.sigma[: estimate.mechanism.n],
            windows=int(solution.problem.balance.use.sum()),
            settled=solution.converged,
            iterations=solution.iterations,
            warnings=(*_warnings(solution), *sentences_of(solution.held)),
            dropped=tuple(dropped),
        ),
        friction,
    )


def _with_held(
    covariance: Covariance, solution: TorqueSolution, sensors: tuple[ParameterBlock, ...]
) -> Covariance:
    """The covariance with held parameters, and what others make up for of these and of sensors."""
    held, problem, estimate = solution.held, solution.problem, solution.estimate
    bound = at_neutral_bound(covariance, estimate.friction)
    if not (held or bound or sensors):
        return covariance
    wider = _problem(problem, (*freed(solution.blocks, held), *sensors), estimate)
    weights = solution.weight / solution.sigma**2
    H, _ = normal_equations(wider.slopes(estimate), solution.residual, weights)
    return with_held(covariance, held, bound, wider.parameters, H + np.diag(wider.limits.precision))


def _weighted(solution: TorqueSolution) -> TorqueSolution:
    """The fit under priors that weigh what they say, see `excess_of`."""
    problem, parameters = solution.problem, solution.problem.parameters
    excess = excess_of(groups_of(solution), parameters)
    if (excess == 1.0).all():
        return solution
    blocks = with_excess(solution.blocks, parameters, excess)
    return solve(_problem(problem, blocks, solution.estimate))


def _at_neutral(solution: TorqueSolution) -> TorqueSolution:
    """The fit with parameters held that the torques do not tell."""

    def holding(before: TorqueSolution, several: tuple[Unknown, ...]) -> TorqueSolution | None:
        after = solve(_holding(several, before))
        rise = squares_like(after, before) - squares_like(before, before)
        clear = any(u.shown(rise) for u in several)
        return None if clear else after._replace(held=(*before.held, *several))

    solution = holding_unknown(solution, _local_cost, holding)[0]
    friction = solution.estimate.friction
    held = followed(friction, solution.held)
    _, friction = at_neutral((), friction, held)
    return solution._replace(estimate=solution.estimate._replace(friction=friction), held=held)


def _holding(several: Sequence[Unknown], solution: TorqueSolution) -> TorqueProblem:
    """The problem that begins where a fit ended, but for parameters held at neutral values."""
    problem = solution.problem
    values = values_of(solution.estimate, problem.blocks)
    keys = [p.key for p in problem.parameters]
    values[[keys.index(u.parameter.key) for u in several]] = [u.neutral for u in several]
    estimate = with_values(solution.estimate, problem.blocks, values)
    blocks = at_neutral(solution.blocks, estimate.friction, several)[0]
    return _problem(problem, blocks, estimate)


def _local_cost(solution: TorqueSolution) -> LocalCost:
    problem, estimate = solution.problem, solution.estimate
    values, groups = values_of(estimate, problem.blocks), groups_of(solution)
    return LocalCost(problem.parameters, values, groups, estimate.friction, solution.blocks)


def check_blocks(
    blocks: Sequence[ParameterBlock], estimate: Estimate, balance: TorqueBalance
) -> None:
    """Refuse blocks that the balance of torques does not show, and joints that never slide."""
    name, names = balance.dataset.name, [b.name for b in blocks]
    for block in names:
        if block not in BLOCKS:
            raise InputError(
                f"block {block!r}: inverse dynamics does not show it; free it by shooting, or one "
                f"of {', '.join(BLOCKS)}"
            )
        if names.count(block) > 1:
            raise InputError(f"block {block!r} is given twice")
    torque = bool(balance.dataset.actuated.any())
    base = estimate.mechanism.base_names
    free = {b.name: b.parameters(estimate) for b in blocks}
    informed = have_prior(free)
    # recordings that differ by known amounts, such as a payload, give the others their scale
    loaded = bool(np.ptp(balance.base[balance.use], axis=0).any()) and torque
    if (
        not loaded
        and len(free.get("inertia", ())) == len(base)
        and not informed
        and (not torque or "gain" in free)
    ):
        what = "without motor torque" if not torque else "beside a free gain"
        raise InputError(
            f"data set {name!r}: {what} only ratios of inertia, gravity and friction show in the "
            f"motion: fix one base parameter that you are sure of, such as {base[-1]!r}, or give "
            "a prior"
        )
    undriven = np.flatnonzero(estimate.mechanism.motors == 0)
    if len(undriven) and free.get("inertia") and not informed:
        raise InputError(
            f"data set {name!r}: joint {undriven[0] + 1} has no motor, and its row of the balance "
            "holds for inertia and friction of any size: leave inertia out, give it a prior, or "
            "free it by shooting"
        )
    if free.get("inertia") and not informed and _reads_torque(estimate.friction):
        raise NoFitError(
            f"data set {name!r}: {estimate.friction.law} follows the motors' torque, and beside "
            "free inertias that explains any torque by itself: leave inertia out, give it a "
            "prior, or choose load_dependent, which follows the motion"
        )
    still = ~balance.slides[balance.use].any(axis=0)
    if "friction" in names and still.any():
        j = int(np.argmax(still))
        raise InputError(
            f"data set {name!r}: joint {j + 1} never slides one way for as long as a window: give "
            "recordings in which it does, or shorten the window"
        )


def check_gains(result: Fit, dataset: Dataset) -> None:
    """Refuse gains of torques that nothing known pins: friction alone holds at any scale.

    Raises
    ------
    InputError
        With the joint whose gain is known worst.
    """
    covariance = result.covariance
    low, high = covariance.interval().T
    gains = [k for k, p in enumerate(covariance.parameters) if p.block == "gain"]
    wide = {k: (high[k] - low[k]) / 2 / max(abs(covariance.values[k]), 1e-300) for k in gains}
    wide |= {k: np.inf for k in gains if covariance.bound[k] or not np.isfinite(wide[k])}
    worst = max(wide, key=lambda k: wide[k], default=None)
    if worst is None or wide[worst] < _PINNED:
        return
    parameter, value = covariance.parameters[worst], covariance.values[worst]
    error = f"{value:.2g} +- {wide[worst] * abs(value):.1g}" if np.isfinite(wide[worst]) else "any"
    joint = dataset.mechanism.joints[parameter.place[0]]
    raise InputError(
        f"data set {dataset.name!r}: the {parameter.name} is not pinned ({error}): beside friction "
        "neither gravity nor a known inertia or payload shows in its torque; keep it by fixed = "
        f'["gain.{joint}"], or record a known payload that loads this joint'
    )


def _reads_torque(friction: Friction) -> bool:
    """Whether friction depends on the motors' torque."""
    theta, ones = np.asarray(friction.theta), np.ones((1, friction.n))
    values = np.clip(np.full_like(theta, 0.5), *np.array(friction.law.bounds).reshape(-1, 2).T)
    return reads_of(friction.law, values, Inputs(ones, ones, ones, ones)).u


def _warnings(solution: TorqueSolution) -> list[str]:
    """Sentences on joints whose torque is not explained."""
    balance, estimate = solution.problem.balance, solution.estimate
    gain = logged_gain(estimate)
    counts = solution.weight[:, : len(gain)] > 0
    left = solution.residual[:, : len(gain)] * gain
    friction = balance.problem.mean(along(estimate.friction, balance.nodes))
    friction = friction @ estimate.mechanism.friction_map
    out = []
    for j, c in enumerate(counts.T):
        size, rest = rms(friction[c, j]), rms(left[c, j])
        if rest > _UNEXPLAINED * size:
            out.append(
                f"Torque {j + 1} keeps {rest:.2g} unexplained, beside {size:.2g} of friction: "
                f"{UNEXPLAINED}."
            )
    return out
