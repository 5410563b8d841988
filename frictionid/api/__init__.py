"""The functions of `import frictionid`, with the names and defaults of the command line.

models, methods   laws, models and methods as a user gives them
check, fit, evaluate, compare, suggest, simulate, quick    one task in each file, as in `cli`
listing           all laws, identifiers and their settings as frames

Commands parse their words, call these functions, and print. Objects and frames come back; nothing
is written where no path is given.
"""
