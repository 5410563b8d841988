"""Settings of identifiers by name: they are those of laws and fits, and bad ones are refused."""

import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from sklearn.dummy import DummyRegressor
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.neighbors import KNeighborsRegressor

from frictionid.comparison.suite import identifier_named
from frictionid.errors import InputError
from frictionid.fitting.identifiers import Frictionless, LeastSquares, Regressor, SINDy
from frictionid.fitting.identifiers.check_identifier import synthetic_problem, synthetic_weights
from frictionid.fitting.identifiers.compressed import CompressedNetwork
from frictionid.fitting.identifiers.network import Network
from frictionid.fitting.identifiers.network_data import window
from frictionid.friction.laws import (
    LSTM,
    MLP,
    Dahl,
    Ensemble,
    Library,
    Spline,
    Stribeck,
    WindowMLP,
)

LIBRARY = Library(velocities=(1.0, 2.0), harmonics=(1,))
CHOSEN = [
    ("none", {}, Frictionless()),
    (
        *("stribeck", {"symmetric": False, "width": 0.1, "shape": "arctan"}),
        LeastSquares(Stribeck(0.1, "arctan", symmetric=False)),
    ),
    ("spline", {"degree": 1}, LeastSquares(Spline(degree=1))),
    ("lstm", {"cells": 4, "odd": True, "epochs": 5}, Network(LSTM(4, odd=True), epochs=5)),
    (
        *("mlp", {"hidden": [8], "odd": True, "width": 0.1}),
        CompressedNetwork(MLP((8,), odd=True, width=0.1)),
    ),
    ("mlp", {"inputs": "all", "hidden": [8]}, Network(MLP((8,)), inputs="all")),
    ("mlp", {"solver": "adam"}, Network(MLP())),
    (
        *("window_mlp", {"samples": 4, "members": 2, "rate": 0.02}),
        Network(WindowMLP(4), rate=0.02, members=2),
    ),
    (
        *("sindy", {"velocities": [1.0, 2.0], "harmonics": [1], "optimizer": "sr3", "ensemble": 5}),
        SINDy(LIBRARY, optimizer="sr3", ensemble=5),
    ),
    (
        *("sklearn", {"estimator": "knn", "settings": {"n_neighbors": 4}}),
        Regressor(KNeighborsRegressor(n_neighbors=4)),
    ),
    (
        *("sklearn", {"estimator": "sklearn.linear_model.LinearRegression"}),
        Regressor(LinearRegression()),
    ),
    (
        *("sklearn", {"estimator": "sklearn.dummy:DummyRegressor", "bins": 9}),
        Regressor(DummyRegressor(), bins=9),
    ),
]


@pytest.mark.parametrize(("kind", "settings", "identifier"), CHOSEN)
def test_settings_are_those_of_the_law_and_the_fit(kind, settings, identifier):
    assert repr(identifier_named(kind, settings)) == repr(identifier)


REFUSED = r"""
kind = "lstm"; cells = 0 => cells
kind = "lstm"; free = true => add dissipative = false
kind = "lstm"; epochs = 0 => epochs
kind = "lstm"; rate = 0.0 => rate
kind = "lstm"; device = "tpu" => device
kind = "lstm"; sample_time = 0.0 => sample_time
kind = "lstm"; free = true; dissipative = false; monotone_tail = false; odd = true => odd
kind = "lstm"; targets = 0 => targets
kind = "lstm"; burn_in = -1 => burn_in
kind = "mlp"; hidden = [] => hidden
kind = "mlp"; hidden = [0] => hidden
kind = "mlp"; hidden = [2.5] => hidden
kind = "mlp"; width = 0.0 => width
kind = "mlp"; shape = "step" => shape
kind = "mlp"; nodes = 1 => nodes
kind = "mlp"; prior_deviations = [] => prior_deviations
kind = "mlp"; share = 0.9 => share
kind = "mlp"; rate = 0.1; solver = "levenberg_marquardt" => rate = 0.1 needs solver = "adam"
kind = "mlp"; compile = true => compile = true needs solver = "adam"
kind = "mlp"; device = "cuda" => device = "cuda" needs solver = "adam"
kind = "mlp"; inputs = "all"; solver = "levenberg_marquardt" => needs solver = "adam"
kind = "mlp"; inputs = "both" => inputs
kind = "window_mlp"; samples = 0 => samples
kind = "window_mlp"; members = 0 => members
kind = "window_mlp"; batch = 0.5 => batch
kind = "window_mlp"; sample_time = -1.0 => sample_time
kind = "window_mlp"; presliding = -0.01 => presliding
kind = "window_mlp"; share = 0.0 => share
kind = "blackbox_mlp"; width = -1.0 => width
kind = "sindy"; optimizer = "lasso" => optimizer.*lasso
kind = "sindy"; velocities = [1.0, 1.0] => velocities = \[1.0, 1.0\] must differ
kind = "sindy"; widths = [0.02] => widths = .* repeat width
kind = "sindy"; powers = [0] => powers
kind = "sindy"; thresholds = [2.0] => thresholds\[0\]: it should be less than 1, not 2.0
kind = "sindy"; gear = 0.0 => gear
kind = "sindy_dynamics"; degree = 0 => degree
kind = "sindy_dynamics"; degree = 9 => more than 2000 candidates
kind = "sindy_dynamics"; thresholds = [2.0] => it should be less than 1
kind = "sindy_dynamics"; width = -1.0 => width
kind = "sklearn"; estimator = "gradient_bosting" => did you mean 'gradient_boosting'
kind = "sklearn"; estimator = "sklearn.svm.Nothing" => cannot be imported
kind = "sklearn"; estimator = "sklearn.base.clone" => sklearn:
kind = "sklearn"; estimator = "knn"; settings = {neighbours = 4} => neighbours
kind = "sklearn"; estimator = "knn"; settings = {n_neighbors = -4} => n_neighbors
kind = "sklearn"; estimator = "knn"; bins = 1 => bins
kind = "sklearn"; estimator = "knn"; speeds = [2.0, 1.0] => speeds = \[2.0, 1.0\] .* increase
kind = "sklearn"; estimator = "sklearn.svm.SVC" => SVC\(\) is no regressor
kind = "sklearn"; estimator = "sklearn.cluster.KMeans" => KMeans\(\) is no regressor
kind = "sklearn" => estimator
"""


@mistakes(REFUSED)
def test_settings_that_mean_nothing_are_refused(wrong, words):
    problem, settings = synthetic_problem(2), changes(wrong)
    with assert_refused(words):  # at the latest in a fit
        identifier = identifier_named(settings.pop("kind"), settings)
        identifier.fit(problem, synthetic_weights(problem), 0)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Network(Stribeck()),
        lambda: MLP(others=-1),
        lambda: CompressedNetwork(MLP(others=1)),
        lambda: CompressedNetwork(Stribeck()),
        lambda: Ensemble(members=1),
        lambda: Network(WindowMLP(), inputs="all"),
        lambda: window(Dahl(), (), synthetic_problem(1).nodes),
    ],
)
def test_objects_that_mean_nothing_are_refused(make):
    with pytest.raises(InputError):
        make()


def test_what_a_fit_needs_of_a_law_or_an_estimator_is_said():
    with assert_refused(r"inputs = .* must include w"):
        Regressor(Ridge(), ("q",))
