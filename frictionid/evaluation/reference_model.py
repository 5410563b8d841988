"""The rule of the verdict: how far predictions are from those of a reference model [Piironen2017].

The *reference* is the model of the lowest held-out error. The errors of two models differ by chance
of the measurement; their predictions from the same start do not. A model predicts d away from a
reference whose own error is e. Were the reference right but for chance, which is as likely on
either side, the model would be off as often by e - d as by e + d, which it is. The mean norm of
both, over the starts of a recording, in units of that of e, is its *implied loss*, that of all
recordings their geometric mean, which no hard recording rules: of small distances
sqrt(1 + d^2/e^2), about. Its chance is that of the recordings. The *measured loss*, the same of
both errors, keeps a veto: where it contradicts the implied one, it decides.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import stdtr, stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array

from .statistics import FEWEST, REGION, CorrelatedTest, t_test

WITHIN = float(np.log(1.0 + REGION))  # of the logarithm of a loss: no practical difference
CERTAIN = 0.9  # probability from which on a statement counts as shown
_CONTRADICTED = 0.05  # chance of a gap between both losses, below which it is none
_LEAST = 1e-12  # error: smaller ones are rounding
_REST = 0.01  # of the mean of all groups: where a joint rests all models are right, none more so


class StartErrors(NamedTuple):
    """Errors (S, n) of a model's predictions from S starts, in units of what is far.

    group : (S,) recording of each start
    """

    error: Array
    group: Array

    @property
    def bounded(self) -> Array:
        """The errors (S, n), of norm 1 at most; of predictions that are not finite zero."""
        far = np.maximum(np.linalg.norm(self.error, axis=-1, keepdims=True), 1.0)
        return np.where(np.isfinite(far), self.error / far, 0.0)

    @property
    def size(self) -> Array:
        """Norms (S,) of the errors, 1 at most."""
        norm = np.linalg.norm(self.error, axis=-1)
        return np.where(np.isfinite(norm), np.minimum(norm, 1.0), 1.0)

    @property
    def level(self) -> float:
        """Geometric mean, over the recordings, of the mean size of their errors."""
        return float(np.exp(np.log(self.means).mean()))

    @property
    def means(self) -> Array:
        """Mean size (G,) of the errors in each recording."""
        return _means(self.size, self.group)

    @property
    def diverged(self) -> bool:
        """Whether most of the predictions in some recording are not finite."""
        lost = np.asarray(~np.isfinite(self.error).all(axis=-1))
        return any(float(lost[self.group == g].mean()) > 0.5 for g in np.unique(self.group))


class Factor(NamedTuple):
    """By which factor a model is farther off than another one, and its chance.

    low, high : ends of the 80 % interval
    worse, better : probabilities that it is above 1.1, and below 1/1.1
    recordings : behind it
    """

    value: float
    low: float
    high: float
    worse: float
    better: float
    recordings: int

    @property
    def turned(self) -> "Factor":
        """Factor of the other model."""
        low, high = 1.0 / self.high, 1.0 / self.low
        return Factor(1.0 / self.value, low, high, self.better, self.worse, self.recordings)

    @property
    def standing(self) -> str:
        """Whether it is shown to be practically "worse", shown not to be, "adequate", or neither.

        Practically worse is farther off by more than a tenth.
        """
        if self.worse >= CERTAIN:
            return "worse"
        return "adequate" if self.worse <= 1 - CERTAIN else "undecided"


class Loss(NamedTuple):
    """By which factor a model is farther off than the reference.

    implied : by the distance of both predictions; measured : by both errors
    contradicted : whether they differ beyond chance, on both sides of what is practically worse
    """

    implied: Factor
    measured: Factor
    contradicted: bool

    @property
    def factor(self) -> Factor:
        """What decides: the implied factor, the measured one where that contradicts it."""
        return self.measured if self.contradicted else self.implied


def loss(model: StartErrors, reference: StartErrors) -> Loss:
    """Loss of a model against a reference whose errors are from the same starts.

    Raises
    ------
    ValueError
        With fewer than two recordings.

    Examples
    --------
    Noise that both models share does not hide by how much the second one differs:

    >>> rng = np.random.default_rng(0)
    >>> group, noise = np.repeat(np.arange(20), 10), 0.05 * rng.standard_normal((200, 1))
    >>> other = StartErrors(noise + 0.03 * rng.choice([-1, 1], (200, 1)), group)
    >>> losses = loss(other, StartErrors(noise, group))
    >>> [round(f.value, 2) for f in (losses.implied, losses.measured)]
    [1.19, 1.16]
    """
    mirrored = StartErrors(2.0 * reference.bounded - model.bounded, reference.group)
    implied = 0.5 * (model.size + mirrored.size)
    first = _log_ratio(implied, reference.size, reference.group)
    second = _log_ratio(model.size, reference.size, reference.group)
    gap = _log_ratio(model.size, implied, reference.group)
    apart = (first.mean > WITHIN) != (second.mean > WITHIN)
    return Loss(_positive(first), _signed(second), apart and gap.p_value < _CONTRADICTED)


def _log_ratio(first: Array, second: Array, group: Array) -> CorrelatedTest:
    """Test of the mean, over the groups, of the logarithm of the ratio of two means."""
    ratio = np.log(_means(first, group)) - np.log(_means(second, group))
    count = len(ratio)
    if count < 2:
        raise ValueError("starts of one recording: at least 2 recordings")
    error = float(ratio.std(ddof=1)) / np.sqrt(count)
    return t_test(float(ratio.mean()), error, count, WITHIN)


def _means(x: Array, group: Array) -> Array:
    """Mean (G,) of each group, not far below that of the others."""
    _, place = np.unique(group, return_inverse=True)
    mean = np.bincount(place, x) / np.bincount(place)
    return np.maximum(mean, _REST * mean.mean()) + _LEAST


def _signed(test: CorrelatedTest) -> Factor:
    """The factor of a test of its logarithm, which may have either sign."""
    half = float(stdtrit(test.folds - 1, CERTAIN)) * test.error
    value, low, high = np.exp((test.mean, test.mean - half, test.mean + half)).tolist()
    return Factor(value, low, high, test.above, test.below, test.folds)


def _positive(test: CorrelatedTest) -> Factor:
    """The factor of a logarithm that is positive, as a mean square is: few recordings skew it.

    It is its own logarithm that is as likely on either side.
    """
    if test.mean <= 0.0 or test.error == 0.0:
        return _signed(test)
    spread = test.error / test.mean
    half = float(stdtrit(test.folds - 1, CERTAIN)) * spread
    value, low, high = np.exp(test.mean * np.exp((0.0, -half, half))).tolist()
    worse = float(stdtr(test.folds - 1, np.log(test.mean / WITHIN) / spread))
    return Factor(value, low, high, worse, 0.0, test.folds)


class Choice(NamedTuple):
    """Which of several models the rule recommends, by their places.

    best : the reference; None where no model is finite, or too few recordings are held out
    losses : of all models against it, None of itself and of models that diverged
    standings : "best", "diverged", or those of the losses
    order : places from the simplest model to the most complex one
    lacking : models that count as worse because they lack a parameter that the data identify
    preferred : model that is taken whatever the order, see `preferring`
    degenerate : model that would be chosen, but is the preferred one with parameters of zero
    """

    best: int | None = None
    losses: tuple[Loss | None, ...] = ()
    standings: tuple[str, ...] = ()
    order: tuple[int, ...] = ()
    lacking: tuple[int, ...] = ()
    preferred: int | None = None
    degenerate: int | None = None

    @property
    def kept(self) -> list[int]:
        """Models that are not practically worse: the preferred one, then from the simplest."""
        first = [] if self.preferred is None else [self.preferred]
        kept = [i for i in self.order if self.standings[i] not in ("worse", "diverged")]
        return first + kept

    @property
    def simplest(self) -> int | None:
        """The simplest model that is not shown to be practically worse."""
        return next(iter(self.kept), None)

    @property
    def adequate(self) -> int | None:
        """The simplest model that is shown to be not practically worse."""
        fine = (i for i in self.kept if self.standings[i] != "undecided" or i == self.preferred)
        return next(fine, None)

    def distance(self, place: int) -> float:
        """Factor by which a model is farther off than the reference."""
        against = self.losses[place]
        return against.factor.value if against else 1.0

    @property
    def recommended(self) -> int | None:
        """The model that the rule recommends; None where these data cannot tell."""
        return self.adequate if self.adequate == self.simplest else None


def choose(
    errors: Sequence[StartErrors],
    complexity: Array,
    unfit: Array | None = None,
    frictionless: Array | None = None,
) -> Choice:
    """The simplest model that is not practically worse than the reference, see `Factor.standing`.

    Models are simple in the order of their complexity; of equally complex ones the first is that of
    the lower error.

    Parameters
    ----------
    errors : of each of M models, from the same starts
    complexity : array (M,)
        Effective number of parameters; infinite for models that are never simpler than others.
    unfit : bool array (M,), optional
        Models that are reference, or chosen, only where no other is left.
    frictionless : bool array (M,), optional
        Models that are so unless all others are practically worse: motion that hardly shows
        friction does not show that there is none.
    """
    last = np.zeros(len(errors), dtype=bool) if unfit is None else unfit
    choice = _chosen(errors, complexity, last)
    if frictionless is None or choice.best is None:
        return choice
    others = {s for i, s in enumerate(choice.standings) if i != choice.best}
    if frictionless[choice.best] and others <= {"worse", "diverged"}:
        return choice
    return _chosen(errors, complexity, last | frictionless)


def _chosen(errors: Sequence[StartErrors], complexity: Array, last: Array) -> Choice:
    finite = np.array([not model.diverged for model in errors], dtype=bool)
    if not finite.any() or len(np.unique(errors[0].group)) < FEWEST:
        return Choice()
    level = np.where(finite, [model.level for model in errors], np.inf)
    best = int(np.lexsort((-np.asarray(complexity), level, last | ~finite))[0])
    losses = tuple(
        loss(model, errors[best]) if finite[i] and i != best else None
        for i, model in enumerate(errors)
    )
    standings = tuple(
        against.factor.standing if against else "best" if i == best else "diverged"
        for i, against in enumerate(losses)
    )
    order = tuple(int(i) for i in np.lexsort((level, complexity, last)))
    return Choice(best, losses, standings, order)


def unsupported(
    errors: Sequence[StartErrors],
    names: Sequence[frozenset[str]],
    shown: Sequence[frozenset[str] | None],
) -> Array:
    """Models (M,) that add nothing to a simpler one: no parameter that the data identify.

    What chance makes of their further parameters moves predictions, and would count as a loss of
    the simpler one. Not where that one is practically farther off as measured.

    names, shown : as for `preferring`
    """

    def adds_nothing(model: int, simpler: int) -> bool:
        nested, identified = names[simpler] and names[simpler] < names[model], shown[model]
        if not nested or identified is None or identified - names[simpler]:
            return False
        pair = errors[simpler], errors[model]
        if any(e.diverged for e in pair) or len(np.unique(pair[0].group)) < FEWEST:
            return False
        return loss(*pair).measured.value < 1.0 + REGION

    each = range(len(errors))
    return np.array([any(adds_nothing(model, simpler) for simpler in each) for model in each])


def preferring(
    choice: Choice,
    names: Sequence[frozenset[str]],
    shown: Sequence[frozenset[str] | None],
    zero: Sequence[frozenset[str]],
) -> Choice:
    """The choice, where errors cannot tell laws apart, by what the data identify.

    Few recordings scatter more than a parameter's interval. A law that is undecided, and more than
    a tenth farther off, counts as worse where a law that has all of its identified parameters, and
    is not worse, adds one that the data identify. Of undecided laws less than a tenth farther off
    that add an identified parameter to the chosen one the nearest is preferred, unless a law that
    is decided has all that it identifies. A law whose further parameters the fit to all data leaves
    at zero is the simpler one, and named so.

    names, shown, zero : of each model's parameters, of those that data tell from zero, None without
        intervals, and of those that are zero, or velocities, which then mean nothing
    """
    identified = [each or frozenset() for each in shown]
    standings, lacking = list(choice.standings), []
    for i in choice.kept:
        mine = identified[i] or names[i]
        richer = [k for k in choice.kept if mine and mine < names[k]]
        is_far = standings[i] == "undecided" and choice.distance(i) > 1.0 + REGION
        if is_far and any(identified[k] - names[i] for k in richer):
            standings[i] = "worse"
            lacking.append(i)
    choice = choice._replace(standings=tuple(standings), lacking=tuple(lacking))
    if choice.recommended is None:
        return choice
    chosen, mine = choice.recommended, names[choice.recommended]
    for i in choice.order:
        nested = names[i] and mine - zero[chosen] <= names[i] < mine
        if nested and standings[i] != "diverged":
            standings[i] = "adequate"
            return choice._replace(standings=tuple(standings), preferred=i, degenerate=chosen)
    richer = [i for i in choice.kept if mine and mine < names[i] and identified[i] - mine]
    settled = [k for k in choice.kept if standings[k] != "undecided"]
    undecided = [
        i
        for i in richer
        if standings[i] == "undecided" and not any(identified[i] <= names[k] for k in settled)
    ]
    near = [i for i in undecided if choice.distance(i) <= 1.0 + REGION]
    return choice._replace(preferred=min(near, key=choice.distance)) if near else choice
