"""The physics step as machine code, row by row: `dynamics.step` for laws without memory.

The files are those of `dynamics` once more, with loops over joints where these have arrays over
rows: an array costs each operation the way to memory and back, a row stays in the processor. The
same motion comes out but for rounding, tests compare them.
"""
