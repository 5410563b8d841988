"""The physics step of one row as programs of scalars, traced from that on arrays.

What `step`, `zero_crossing` and `torque_balance` compute of arrays is written down for one row. All
that a row holds, and all that programs hand on to each other, are named numbers of one array.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from types import SimpleNamespace
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Inputs, Law
from frictionid.friction.coordinates import (
    at_places,
    is_coupled_by_load,
    of_parts,
    predicted_load,
    resting_parts,
    turns_of,
)
from frictionid.mechanics import Mechanism
from frictionid.programs.program import Program
from frictionid.programs.trace import traced

from ..state import State
from ..step import is_uneven, parts_near_rest, rk4
from ..torque_balance import (
    SETTLED,
    Balance,
    braked,
    constrained,
    first_torque,
    is_sharp,
    least_sliding_speed,
    sliding_velocity,
    swept_torque,
)
from ..zero_crossing import (
    Crossing,
    crossing_jump,
    located,
    minimum_braking,
    since_crossing,
    slid,
    stiction_at,
    stopped_too,
    turned_back,
)

EXTERNAL = "q w memory u dt slow feedback p theta physical".split()  # numbers that loops set
NO_PROGRAM = (NotImplementedError, TypeError, ValueError, AttributeError)


def program_of(
    function: Callable[[Any], Mapping[str, Array]],
    sizes: dict[str, int],
    zeros: Collection[str] = (),
) -> Program:
    """Program of a function of named numbers, of which some are known to be zero."""
    return traced(lambda x: function(SimpleNamespace(**x)), sizes, zeros)


def zero_entries(programs: Iterable[Program]) -> set[str]:
    """Entries of outputs that are always zero."""
    return {x for program in programs for x, operand in program.results() if operand == 0.0}


def places_of(sizes: dict[str, int]) -> dict[str, int]:
    """Where the numbers of each name begin."""
    return dict(zip(sizes, accumulate(sizes.values(), initial=0), strict=False))


@dataclass(frozen=True)
class Row:
    """The programs of one row: each takes its numbers by name, and gives those that it changes."""

    mechanism: Mechanism
    law: Law
    breaks: bool
    feedback: bool = False

    @property
    def sharp(self) -> bool:
        """Whether the law's smoothing only stands for a step at w = 0."""
        return is_sharp(self.law)

    @property
    def coupled_by_load(self) -> bool:
        """Whether friction of a joint depends on that of others, by the load of their gears."""
        return is_coupled_by_load(self.mechanism, self.law)

    @property
    def turns(self) -> Array | None:
        """Turns of the coupled parts."""
        return turns_of(self.mechanism, np.zeros(1))

    @property
    def entries(self) -> int:
        """Entries of the memory."""
        P = len(self.law.names)
        theta = np.ones((len(self.mechanism.friction_names), P))
        zero = np.zeros(len(theta))
        return len(self.law.start(theta, Inputs(zero, zero, zero, zero)))

    @property
    def sizes(self) -> dict[str, int]:
        """How many numbers each name has: state and parameters, then what is computed of them."""
        n, m = self.mechanism.n, len(self.mechanism.friction_names)
        memory = m * self.entries
        joints = "at_q at_w f load q0 w0 a1 a2 a3 w_end jump"
        parts = (
            "v sliding friction low high direction braking sticking firm margin candidates holding "
            "held since stops passes rests share turned"
        )
        single = "is_slow is_near uneven crosses loosens turns_back at_stake moved"
        return {
            **{"q": n, "w": n, "memory": memory, "u": n, "dt": 1, "slow": m},
            "feedback": 2 * n if self.feedback else 0,
            **{"p": len(self.mechanism.base_names), "theta": m * len(self.law.names)},
            "physical": len(self.mechanism.defaults) if self.law.uses_load else 0,
            **dict.fromkeys(joints.split(), n),
            **dict.fromkeys(parts.split(), m),
            **dict.fromkeys(single.split(), 1),
            **{"M": n * n, "W": m * m, "memory0": memory, "M0": n * n, "M_end": n * n},
        }

    @property
    def sequences(self) -> dict[str, tuple[str, ...]]:
        """Programs that are run one after the other."""
        evaluate = ("dynamics", "aim", "torque")
        smooth: tuple[str, ...] = (
            "stage_1",
            *evaluate,
            "stage_2",
            *evaluate,
            "stage_3",
            *evaluate,
            "stage_4",
        )
        if self.entries:  # half of the time before, and half behind
            smooth = ("advance", *evaluate, "accelerate", *smooth, "dynamics", "advance")
        balance = ("dynamics", "push_back", "limit", "push_on", "limit")
        sliding = (*balance, "aim", "torque")
        way = "aim" if self.sharp else "straight"
        return {
            "near_rest": (*balance, way, "torque", "choose_slow", "hold"),
            "brake": ("set_braking", "hold"),
            "stick": ("set_stiction", "aim", "torque", "accelerate"),
            "first": (*evaluate, "accelerate"),
            "smooth": smooth,
            "look_back": (*sliding, "choose_crossing", "hold"),
            "change_side": ("locate", "torque", "turn_back"),
        }

    @cached_property
    def _zeros_of_inertia(self) -> list[str]:
        zeros = zero_entries([program_of(self.dynamics, self.sizes)])
        return [x.partition("_")[2] for x in zeros if x.startswith("M_")]

    @property
    def inertias(self) -> int:
        """How many entries of the mass matrix are not zero."""
        return self.sizes["M"] - len(self._zeros_of_inertia)

    @property
    def zeros(self) -> frozenset[str]:
        """Entries of mass matrices that are zero, such as those between two legs."""
        names = ("M", "M0", "M_end")
        return frozenset(f"{name}_{k}" for name in names for k in self._zeros_of_inertia)

    # ------------------------------------------------------------ torques

    def motor_torque(self, x: Any) -> Array:
        """Motor torques (n,), in closed loop where there is a feedback."""
        n = len(x.u)
        return x.u - x.feedback[:n] * x.at_q - x.feedback[n:] * x.at_w if self.feedback else x.u

    def inputs(self, x: Any) -> Inputs:
        """What friction may depend on, where the row is evaluated."""
        return at_places(self.mechanism, Inputs(x.at_q, x.at_w, self.motor_torque(x), x.load))

    def memory(self, x: Any) -> tuple[Array, ...]:
        """Entries (m,) of the memory."""
        return tuple(x.memory.reshape(self.entries, len(x.slow)))

    def of_law(self, function: Callable[..., Array], x: Any, w: Array) -> Array:
        """Value (m,) of a torque or limit with velocities w."""
        theta = x.theta.reshape(len(w), -1)
        return function(theta, self.inputs(x)._replace(w=w), self.memory(x)) + 0.0 * w

    def later_memory(self, x: Any, w: Array) -> Array:
        """Memory (e m,) after half of the time with velocities w."""
        theta, at = x.theta.reshape(len(w), -1), self.inputs(x)._replace(w=w)
        later = self.law.advance(theta, at, self.memory(x), x.dt / 2)
        return np.concatenate([x.memory[:0], *(entry + 0.0 * w for entry in later)])

    def velocities(self, x: Any) -> Array:
        """Velocities (m,) of all parts, exactly zero at rest."""
        return resting_parts(x.w, self.turns)

    def balance(self, x: Any, friction: Array) -> Balance:
        """Torques, with this friction of sliding parts."""
        n = len(x.q)
        return Balance(x.M.reshape(n, n), x.f, friction, x.low, x.high, self.turns)

    def dynamics(self, x: Any) -> dict[str, Array]:
        M, h = self.mechanism.dynamics(x.p, x.at_q, x.at_w)
        u = self.motor_torque(x)
        out = {"M": M, "f": h + u * self.mechanism.motors}
        if self.law.uses_load:
            physical = {k: x.physical[i] for i, k in enumerate(self.mechanism.defaults)}
            base = (x.p,) if self.mechanism.loads_of_gears else ()
            out["load"] = predicted_load(
                self.mechanism,
                self.law,
                x.theta.reshape(len(x.slow), -1),
                Inputs(x.at_q, x.at_w, u, 0.0 * u),
                lambda u: self.mechanism.load(physical, x.at_q, x.at_w, u, *base),
            )
        return out

    def aim(self, x: Any) -> dict[str, Array]:
        least = least_sliding_speed(self.law) if self.breaks else 0.0
        return {"v": sliding_velocity(self.inputs(x).w, x.direction, least)}

    def straight(self, x: Any) -> dict[str, Array]:
        return {"v": self.inputs(x).w}

    def torque(self, x: Any) -> dict[str, Array]:
        law = self.law.sharpened() if self.breaks else self.law
        return {"sliding": self.of_law(law.torque, x, x.v)}

    def push_back(self, x: Any) -> dict[str, Array]:
        return {"v": 0.0 * x.v - 1.0}

    def limit(self, x: Any) -> dict[str, Array]:
        return {"high": self.of_law(self.law.limit, x, x.v)}

    def push_on(self, x: Any) -> dict[str, Array]:
        return {"low": x.high, "v": 0.0 * x.v + 1.0}

    def advance(self, x: Any) -> dict[str, Array]:
        return {"memory": self.later_memory(x, self.inputs(x).w)}

    def acceleration(self, x: Any) -> Array:
        """Accelerations (n,) where the row has been evaluated."""
        now = self.balance(x, braked(x.sliding, x.braking))
        return constrained(now.M, now.left(now.friction), x.sticking, self.turns)

    def accelerate(self, x: Any) -> dict[str, Array]:
        a, velocity = self.acceleration(x), of_parts(x.w, self.turns)
        near: Any = parts_near_rest(velocity, of_parts(a, self.turns), x.slow, x.firm, x.dt)
        return {"a1": a, "is_near": near.any(-1)}

    # ------------------------------------------------------------ Runge-Kutta

    def stage_1(self, x: Any) -> dict[str, Array]:
        at_q, at_w = self._points(x, x.q, x.w, [x.a1])[0][0]
        return {"q0": x.q, "w0": x.w, "M0": x.M, "at_q": at_q, "at_w": at_w}

    def stage_2(self, x: Any) -> dict[str, Array]:
        a = self.acceleration(x)
        at_q, at_w = self._points(x, x.q0, x.w0, [x.a1, a])[0][1]
        return {"a2": a, "at_q": at_q, "at_w": at_w}

    def stage_3(self, x: Any) -> dict[str, Array]:
        a = self.acceleration(x)
        at_q, at_w = self._points(x, x.q0, x.w0, [x.a1, x.a2, a])[0][2]
        return {"a3": a, "at_q": at_q, "at_w": at_w}

    def stage_4(self, x: Any) -> dict[str, Array]:
        accelerations = [x.a1, x.a2, x.a3, self.acceleration(x)]
        q, w, bend = self._points(x, x.q0, x.w0, accelerations)[1]
        after = {"q": q, "w": w, "w_end": w, "at_q": q, "at_w": w}
        begins, ends = (resting_parts(v, self.turns) for v in (x.w0, w))
        firm = x.firm if self.breaks else 1.0 + 0.0 * x.firm
        uneven = is_uneven(of_parts(bend, self.turns), begins, ends, firm, x.slow)
        return after | {"uneven": uneven} | self._events(x, w)

    def _points(
        self, x: Any, q: Array, w: Array, accelerations: list[Array]
    ) -> tuple[list[tuple[Array, Array]], tuple[Array, Array, Array]]:
        """States at which later accelerations are needed, and what `rk4` gives."""
        points = []
        later = iter([*accelerations[1:], *[accelerations[0]] * 3])

        def accelerate(q: Array, w: Array) -> Array:
            points.append((q, w))
            return next(later)

        return points, rk4(accelerate, q, w, x.dt, accelerations[0])

    def _events(self, x: Any, w: Array) -> dict[str, Array]:
        velocity = resting_parts(w, self.turns)
        crosses: Any = (x.direction * velocity < 0.0).any(-1)
        still: Any = (x.sticking & (velocity == 0.0)).any(-1)
        if not self.breaks:
            crosses = still = 0.0 * x.dt
        return {"crosses": crosses, "loosens": still & (velocity != 0.0).any(-1)}

    # ------------------------------------------------------------ rest

    def begin(self, x: Any) -> dict[str, Array]:
        w, zero, n = self.velocities(x), 0.0 * x.slow, len(x.w)
        slow: Any = self.slow(x).any(-1) if self.breaks else 0.0 * x.dt
        # joints that other parts hold, too, are at rest
        start = {"w": w[:n], "at_q": x.q, "at_w": w[:n], "memory0": x.memory, "is_slow": slow}
        none = dict.fromkeys(("braking", "sticking", "firm", "margin"), zero)
        return {**start, "direction": np.sign(w), **none}

    def slow(self, x: Any) -> Array:
        """Parts (m,) that are slow; of a sharp law, that rest."""
        least = 0.0 * x.slow if self.sharp else x.slow
        return np.abs(self.velocities(x)) <= least

    def choose_slow(self, x: Any) -> dict[str, Array]:
        return {"candidates": self.slow(x), "holding": x.sliding}

    def hold(self, x: Any) -> dict[str, Array]:
        W, Tf = first_torque(self.balance(x, x.holding), x.candidates)
        return {"W": W, "held": Tf}

    def settle(self, x: Any) -> dict[str, Array]:
        m = len(x.slow)
        Tf = swept_torque(self.balance(x, x.holding), x.W.reshape(m, m), x.held, x.candidates)
        return {"held": Tf, "moved": (np.abs(Tf - x.held) > SETTLED).any(-1)}

    def set_braking(self, x: Any) -> dict[str, Array]:
        w = self.velocities(x)
        braking = minimum_braking(self.balance(x, x.sliding), x.held, w, x.candidates)
        holding = braked(x.sliding, braking)
        return {"braking": braking, "candidates": w == 0.0, "holding": holding}

    def set_stiction(self, x: Any) -> dict[str, Array]:
        w = self.velocities(x)
        now = stiction_at(self.balance(x, x.holding), x.held, w, None)
        names = ("direction", "sticking", "firm", "margin")
        return {name: getattr(now, name) for name in names}

    # ------------------------------------------------------------ crossings

    def crossing(self, x: Any) -> Crossing:
        """The row's crossing."""
        M = x.M.reshape(len(x.q), -1)
        return Crossing(x.stops, x.passes, x.rests, x.share, x.jump, M, x.w_end, self.turns)

    def choose_crossing(self, x: Any) -> dict[str, Array]:
        friction = braked(x.sliding, x.braking)
        crossed = x.direction * self.velocities(x) < 0.0
        return {"candidates": crossed | x.sticking, "holding": friction, "friction": friction}

    def locate(self, x: Any) -> dict[str, Array]:
        start, end = (resting_parts(w, self.turns) for w in (x.w0, x.w))
        crossed = x.direction * end < 0.0
        now = self.balance(x, x.friction)
        at = located(now, x.held, crossed, x.sticking, start, end, x.w)
        other = SimpleNamespace(**vars(x) | {"direction": -x.direction})
        out = {"stops": at.stops, "passes": at.passes, "rests": at.sticking}
        return out | {"share": at.share, "jump": at.jump, **self.aim(other)}

    def turn_back(self, x: Any) -> dict[str, Array]:
        crossing = self.crossing(x)
        since = since_crossing(self.balance(x, x.friction), x.sliding, crossing).friction
        turned = turned_back(crossing, x.direction, x.dt)
        out = {"since": since, "holding": since, "turned": turned}
        return out | {"candidates": x.rests | turned, "turns_back": turned.any(-1)}

    def stop_more(self, x: Any) -> dict[str, Array]:
        turned = x.turned & self.balance(x, x.since).below_break_away(x.held)
        at = stopped_too(self.crossing(x), turned)
        out = {"stops": at.stops, "rests": at.sticking, "share": at.share}
        return out | {"candidates": at.sticking, "at_stake": (x.sticking | turned).any(-1)}

    def end_crossing(self, x: Any) -> dict[str, Array]:
        now, since = self.balance(x, x.friction), self.balance(x, x.since)
        jump = crossing_jump(now, since, x.held, self.crossing(x), x.at_stake[0])
        crossing = self.crossing(x)._replace(jump=jump)
        q, w = crossing.state_after(State(x.q0, x.w0), x.q, x.dt)
        return {"jump": jump, "q": q, "w": w, "M_end": x.M, "uneven": 1.0 + 0.0 * x.dt}

    def slide(self, x: Any) -> dict[str, Array]:
        now = self.balance(x, x.friction)
        q, w = slid(now, x.held, x.sticking, x.margin, State(x.q, x.w), x.dt)
        slides: Any = (w != x.w).any(-1)
        return {"q": q, "w": w, "uneven": slides | (x.uneven != 0.0)}
