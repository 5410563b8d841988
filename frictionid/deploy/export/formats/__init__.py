"""Formats of exported friction: one a file, whose name is that of the format.

A file has the function

    write(model, settings)    what is written, and what the target cannot hold, as `Written`

of an `ExportedFriction` and `ExportSettings`. Beside it there may be `held(model)`, the friction
that the target computes in place of the model's, and `replay(model, written)`, how far its engine
is from our predictions. What it cannot hold at all a format refuses by an `InputError`.
"""
