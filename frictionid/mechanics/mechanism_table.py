"""Mechanisms of [mechanism] tables: of a kind, of one's own code, or of a file."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.config import check_arguments, nearest, untrusted
from frictionid.errors import InputError
from frictionid.files import sha256

from .built_in import acrobot, double_pendulum, linear_axis, two_mass_axis
from .mechanism import Mechanism
from .pendulum import pendulum
from .rigid_body.base_parameters import base_parameters
from .rigid_body.rigid_body_tree import RigidBodyTree, parameters_of_tree
from .rigid_body.robot import Choice, Couplings, Robot, Tree, tree_of, with_rotors
from .rigid_body.robot_files import read_mjcf, read_urdf

# From `module:function` to the function.
Code = Callable[[str], Any]

_KINDS: Mapping[str, Callable[..., Mechanism]] = {
    "acrobot": acrobot,
    "double_pendulum": double_pendulum,
    "linear_axis": linear_axis,
    "pendulum": pendulum,
    "two_mass_axis": two_mass_axis,
}


def mechanism_of(table: Mapping[str, Any], code: Code | None = None) -> Mechanism:
    """Mechanism of a [mechanism] table: its `kind`, with the options and parameters given there.

    A file that describes it, such as `urdf`, stands in place of the kind. A kind `module:function`
    is a function of one's own that gives a mechanism: code, which runs only where the caller says
    how it is imported.

    Parameters
    ----------
    table : mapping
    code : function from "module:function" to the function, optional

    Raises
    ------
    InputError
        For an unknown kind, option or parameter, with the nearest name.

    >>> mechanism_of({"kind": "pendulum", "parameters": {"mass": 0.5}})
    pendulum(mass=0.5)
    """
    kind, build = _kind(table, code)
    tables = ("kind", "parameters", "tolerances")
    options = {key: value for key, value in table.items() if key not in tables}
    mechanism = _built(build, kind, options)
    for name, what in (("parameters", "number"), ("tolerances", "percent")):
        entries = table.get(name, {})
        if not isinstance(entries, Mapping):
            raise InputError(f"[mechanism] {name} = {entries!r} must be a table: name = {what}")
    mechanism = replace(mechanism, kind=kind, options=options)
    mechanism = mechanism.with_values(table.get("parameters", {}))
    return replace(mechanism, tolerances=table.get("tolerances", {}))


def as_mechanism(mechanism: Any) -> Mechanism:
    """A mechanism as it is, and that of a [mechanism] table.

    >>> as_mechanism(pendulum(mass=0.5))
    pendulum(mass=0.5)
    """
    if isinstance(mechanism, Mechanism):
        return mechanism
    if not isinstance(mechanism, Mapping):
        raise InputError(
            f"a mechanism must be one of frictionid.mechanics, such as pendulum(mass=0.4, "
            f"length=0.25), or a [mechanism] table, not {mechanism!r:.60}"
        )
    return mechanism_of(mechanism)


def _kind(table: Mapping[str, Any], code: Code | None) -> tuple[str, Callable[..., Mechanism]]:
    """Name of the kind of a table, and what builds it; a file's format is a kind as well."""
    described = [name for name in FORMATS if name in table]
    if described and "kind" in table or len(described) > 1:
        raise InputError(
            f"[mechanism] names {' and '.join([*described, *('kind',) * ('kind' in table)])}; "
            "a mechanism is one of them: remove the others"
        )
    if described:
        return described[0], FORMATS[described[0]]
    kind = str(table.get("kind", ""))
    if ":" in kind:
        if code is None:
            raise InputError(f"[mechanism] kind = {untrusted(kind)}")
        build: Callable[..., Mechanism] = code(kind)
        if not callable(build):
            raise InputError(f"[mechanism] kind = {kind!r} is no function that gives a mechanism")
        return kind, build
    if kind not in _KINDS:
        raise InputError(
            f"[mechanism] kind = {kind!r} is unknown; {nearest(kind, _KINDS)}; or name the file "
            'that describes it: urdf = "arm.urdf"'
        )
    return kind, _KINDS[kind]


def _built(build: Callable[..., Mechanism], kind: str, options: Mapping[str, Any]) -> Mechanism:
    """What the function of a kind gives for the options of a table."""
    names = mechanism_options(build)
    for name in options:
        if name not in names:
            raise InputError(f"[mechanism] {kind} has no option {name!r}; {nearest(name, names)}")
    plain = kind in _KINDS or ":" in kind
    settings = {name: _frozen(name, v) if plain else v for name, v in options.items()}
    try:
        mechanism = build(**settings)
    except InputError:
        raise
    except Exception as error:
        if ":" in kind:
            said = f"{kind!r} failed, {type(error).__name__}: {error}"
            raise InputError(f"[mechanism] {said}") from error
        raise
    if not isinstance(mechanism, Mechanism):
        raise InputError(
            f"[mechanism] {kind!r} must give a mechanism, not a {type(mechanism).__name__}"
        )
    return mechanism


def mechanism_options(build: Callable[..., Mechanism]) -> dict[str, Any]:
    """Options of a kind with their defaults; keywords of its constructor are its parameters.

    >>> mechanism_options(pendulum)
    {'driven': True, 'motor': False}
    """
    arguments = inspect.signature(build).parameters.values()
    return {p.name: p.default for p in arguments if p.kind is not p.KEYWORD_ONLY}


def _frozen(name: str, value: Any) -> Any:
    entries = value if isinstance(value, list) else [value]
    if any(isinstance(e, list | Mapping) for e in entries):
        raise InputError(f"[mechanism] {name} = {value!r} must be a value or a list of values")
    return tuple(value) if isinstance(value, list) else value


def mechanism_kinds() -> Mapping[str, Callable[..., Mechanism]]:
    """Kinds of mechanisms, and the functions that build them of their options.

    >>> sorted(mechanism_kinds())
    ['acrobot', 'double_pendulum', 'linear_axis', 'pendulum', 'two_mass_axis']
    """
    return _KINDS


# --- Of files: which of the joints move, from where, with which payload ---------------------------


def urdf(
    urdf: str | Path,
    joints: Sequence[str] | None = None,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
    gravity: Sequence[float] | None = None,
    payload: str | None = None,
    driven: Sequence[bool] | bool = True,
    coupled: Couplings | None = None,
    floating: bool = False,
) -> RigidBodyTree:
    """Mechanism of n joints that a URDF describes.

    Parameters
    ----------
    urdf : path
    joints : names of the joints that move, in the order of the recordings' columns
        All that can, if not given. The others are locked.
    base : link that stands still
        The root, if not given; what it does not carry is left out.
    locked : positions [rad or m] of joints that do not move, zero if not named
    gravity : (x, y, z) [m/s^2] in the frame of the base, (0, 0, -9.81) if not given
    payload : link that carries a payload
        Its mass, centre of mass and inertia then are parameters payload_mass, ... of each
        recording.
    driven : whether each joint has a motor, or one answer for all
    coupled : motors, or other parts, that turn with several joints, and so have friction and an
        inertia of their own: {"motor_6": {"joint_5": 1.0, "joint_6": 1.0}} for one that turns by as
        much as these two together
    floating : whether the base moves, as recordings say: the link that a free joint carries, if
        none is named; gravity then is that of a base that stands upright

    Raises
    ------
    InputError
        Where the file is no URDF, its joints are no tree, or an option does not fit them.
    """
    return _mechanism("urdf", read_urdf, locals())


def mjcf(
    mjcf: str | Path,
    joints: Sequence[str] | None = None,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
    gravity: Sequence[float] | None = None,
    payload: str | None = None,
    driven: Sequence[bool] | bool = True,
    coupled: Couplings | None = None,
    floating: bool = False,
) -> RigidBodyTree:
    """Mechanism of n joints that an MJCF describes, with its armatures as rotors; see `urdf`.

    Gravity is that of the file if not given. MuJoCo reads the file and must be installed.
    """
    return _mechanism("mjcf", read_mjcf, locals())


_TURNS = 1e6  # of a coupled part for one of a joint, at most
FORMATS: Mapping[str, Callable[..., RigidBodyTree]] = {"urdf": urdf, "mjcf": mjcf}


def _mechanism(
    kind: str, read: Callable[[Path], Robot], arguments: Mapping[str, Any]
) -> RigidBodyTree:
    """Mechanism of a file, under the name of its format, and of options."""
    file = arguments[kind]
    if not isinstance(file, str | Path):
        raise InputError(f'[mechanism] {kind} = {file!r} must be a file: {kind} = "arm.{kind}"')
    robot = read(Path(file))
    choice = Choice(**{name: arguments[name] for name in Choice._fields})
    payload, usual = choice.payload, choice._field_defaults
    changed = {k: value for k, value in choice._asdict().items() if value is not usual[k]}
    _check_choice(choice)
    tree, attached = tree_of(robot, choice)
    if payload is not None and payload not in attached:
        raise InputError(
            f"{robot.place}: payload = {payload!r} is no link beyond the base; "
            f"{nearest(payload, attached)}"
        )
    at = None if payload is None else attached[payload]
    if at is not None and at.body < 0:
        raise InputError(
            f"{robot.place}: payload = {payload!r} does not move; name a link beyond a joint"
        )
    coupled = _coupled(choice.coupled, tree)
    tree = with_rotors(tree, coupled)
    named = {joint.name: joint.rotor for joint in robot.joints}
    rotors = np.array([*(named[name] for name in tree.joints), *(0.0 for _ in coupled)])
    reduction = base_parameters(tree, np.concatenate([tree.inertia.ravel(), rotors]))
    return RigidBodyTree(
        kind=kind,
        joints=tree.joints,
        position_units=tuple("m" if p else "rad" for p in tree.prismatic),
        driven=_driven(choice.driven, tree.joints),
        parameters=parameters_of_tree(tree, rotors, payload is not None),
        base_names=reduction.names,
        base_units=reduction.units,
        base_meanings=("",) * len(reduction.names),
        options={kind: robot.place, **changed},
        coupled=coupled,
        floating=tree.floating,
        tree=tree,
        reduction=reduction,
        identity=_identity(tree),
        payload=at,
    )


def _check_choice(choice: Choice) -> None:
    check_arguments(Choice, choice._asdict(), "[mechanism] options")
    gravity = choice.gravity
    if gravity is not None and not (len(gravity) == 3 and max(map(abs, gravity)) < 1e3):
        raise InputError(
            f"[mechanism] gravity = {gravity!r} must be three numbers [m/s^2] in the frame of the "
            "base: [0.0, 0.0, -9.81] where its z axis points up"
        )


def _driven(driven: Sequence[bool] | bool, joints: tuple[str, ...]) -> tuple[bool, ...]:
    each = (driven,) * len(joints) if isinstance(driven, bool) else tuple(driven)
    if len(each) != len(joints):
        raise InputError(
            f"[mechanism] driven = {driven!r} must be true, false or one of these for each of "
            f"{', '.join(joints)}"
        )
    return each


def _coupled(table: Couplings | None, tree: Tree) -> tuple[tuple[str, tuple[float, ...]], ...]:
    """Names of the coupled parts, and their turns for one of each joint."""
    if table is None:
        return ()
    example = "coupled.motor_6 = { joint_5 = 1.0, joint_6 = 1.0 }"
    out = []
    for name, turns in table.items():
        where = f"[mechanism] coupled: {name}"
        if len(turns) < 2:
            raise InputError(f"{where} = {turns!r} must name two joints or more: {example}")
        if name in tree.joints:
            raise InputError(f"{where} has the name of a joint; call it otherwise, as {example}")
        for joint, value in turns.items():
            if joint not in tree.joints:
                raise InputError(
                    f"{where} names {joint!r}, no joint that moves; {nearest(joint, tree.joints)}"
                )
            if not 0 < abs(value) < _TURNS:
                raise InputError(f"{where}: {joint} = {value!r} must be its turns, not zero")
        out.append((name, tuple(float(turns.get(joint, 0.0)) for joint in tree.joints)))
    return tuple(out)


def _identity(tree: Tree) -> str:
    arrays = (tree.parent, tree.prismatic, tree.axis, tree.turn, tree.shift, tree.inertia)
    every = (*arrays, tree.rotors, tree.gravity)
    return sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in every))
