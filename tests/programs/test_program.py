"""Programs agree with functions of arrays, derivatives with differences, machine code with both."""

import numpy as np
import pytest

from frictionid.programs.machine_code import machine_code, run
from frictionid.programs.program import with_derivatives
from frictionid.programs.trace import traced

FUNCTIONS = {
    "sums": lambda x, y: x - y + 3.0 * x,
    "products": lambda x, y: x * y / (1.0 + y * y),
    "powers": lambda x, y: (1.5 + x * x) ** 2.5 + (2.0 + x * x) ** y,
    "roots and logarithms": lambda x, y: np.sqrt(2.0 + x * x) + np.log(3.0 + x) + np.log1p(y * y),
    "sines": lambda x, y: np.sin(2.0 * x) * np.cos(x - y),
    "saturations": lambda x, y: np.tanh(3.0 * x) * np.exp(-y) + np.arctan(x * y),
    "kinks": lambda x, y: np.abs(x) + np.maximum(x, y) - np.minimum(0.3, y),
    "choices": lambda x, y: np.where((x > 0) & (y < 1.0), x * x, x * y) * np.sign(x),
    "other choices": lambda x, y: np.where((x <= y) | ~(x < 0.4), x * y, np.logaddexp(x, y)),
}
POINTS = [(0.7, 0.2), (-0.8, 1.3), (0.4, 0.9), (-0.35, -0.6)]


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("point", POINTS)
def test_derivatives_agree_with_differences(name, point):
    function, step = FUNCTIONS[name], 1e-6
    program = traced(lambda v: {"z": function(v["x"], v["y"])}, {"x": 1, "y": 1})
    both = with_derivatives(program, {"x": ["x_1"], "y": ["y_1"]}, ["z"])
    made = both.run({"x_1": point[0], "y_1": point[1]})
    for own, name_of in enumerate("xy"):
        up, down = (np.array(point), np.array(point))
        up[own], down[own] = up[own] + step, down[own] - step
        rise = (function(*up) - function(*down)) / (2 * step)
        assert made[f"z by {name_of}"][0] == pytest.approx(rise, rel=1e-7, abs=1e-8)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_machine_code_computes_what_the_program_does(name):
    program = traced(lambda v: {"z": FUNCTIONS[name](v["x"], v["y"])}, {"x": 1, "y": 1})
    places = {"x": 0, "y": 1, "z": 2}
    code = machine_code({"f": program}, places)["f"]
    for x, y in POINTS:
        row = np.array([x, y, 0.0])
        run(code, row)
        assert row[2] == pytest.approx(program.run({"x_1": x, "y_1": y})["z"][0], rel=1e-14)


def test_directions_of_several_inputs_add_up():
    program = traced(lambda v: {"z": v["x"][0] * v["x"][1]}, {"x": 2})
    made = with_derivatives(program, {"both": ["x_1", "x_2"]}, ["z"]).run({"x_1": 2.0, "x_2": 5.0})
    assert made["z by both"] == [7.0]


def test_systems_and_products_are_those_of_arrays():
    M, b = np.random.default_rng(0).normal(size=(3, 3)), np.array([1.0, -2.0, 0.5])
    M = M @ M.T + np.eye(3)  # elimination without pivots is for matrices of masses

    def functions(M, b):
        solved, inverse = np.linalg.solve(M, b[:, None])[:, 0], np.linalg.inv(M)
        return {"solved": solved, "inverse": inverse, "left": b @ M, "right": M @ b}

    program = traced(lambda x: functions(x["M"].reshape(3, 3), x["b"]), {"M": 9, "b": 3})
    values = dict(zip(program.inputs, np.concatenate([M.ravel(), b]), strict=True))
    for name, result in program.run(values).items():
        np.testing.assert_allclose(result, functions(M, b)[name].ravel(), rtol=1e-12)
