"""Pooling: fitted models of several specimens as one, with the spread between them.

random_effects   estimates of one quantity, each with its error: mean, spread, the next specimen
models           estimates of fitted models, parameter by parameter, pooled to one friction
pool             what a user asks for: pooled models, and parameters over a covariate
"""
