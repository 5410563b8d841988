"""A mechanism of one's own: a cart with a motor on a level track, and a pole that swings from it.

In Python it is an object, `cart_pole().with_values({"cart": 0.8})`. A suite has the line
`mechanism = "own_mechanism:cart_pole"` beside the path of a data set; a dataset.toml may have it as
its kind, and is then read with --trust.
"""

import sympy as sp

from frictionid.mechanics import Body, Joint, Mechanism, Parameter, from_bodies


def cart_pole() -> Mechanism:
    """Cart (position in m) and pole (angle in rad, hanging down at 0)."""
    x, q, cart, mass, length, inertia = sp.symbols("x q cart mass length inertia")
    return from_bodies(
        bodies=(
            Body(cart, x, 0, joint=0),
            Body(mass, x + length * sp.sin(q), -length * sp.cos(q), inertia, angle=q, joint=1),
        ),
        joints=(Joint("cart", x, "m"), Joint("pole", q, "rad", driven=False)),
        parameters=(
            Parameter("cart", 0.5, "kg", "mass of the cart"),
            Parameter("mass", 0.2, "kg", "mass of the pole"),
            Parameter("length", 0.3, "m", "from the joint to the pole's centre of mass"),
            Parameter("inertia", 0.006, "kg m^2", "of the pole about its centre of mass"),
            Parameter("g", 9.81, "m/s^2", "gravity"),
        ),
        kind="own_mechanism:cart_pole",
    )
