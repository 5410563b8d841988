"""From a problem to a fit.

identifier           what is fitted by users' own parts: friction of all folds
parameters           what may be free: friction, inertia, sensors, servos; each with a tolerance
fit                  what every method gives: friction, covariance, diagnostics
one_step, shooting, torque_balance    the methods; identifiers: of one-step problems
"""
