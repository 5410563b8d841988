"""The physics step and its derivatives as machine code, row by row.

An array costs each operation the way to memory and back, a row stays in the processor: predictions
with LuGre friction take a tenth of the time on arrays, with friction under bearing loads a
seventieth. Programs of a row are traced from the functions of arrays; only when they are run is
written here.
"""
