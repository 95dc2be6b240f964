"""One formula, many targets: record a formula once, run it on every lane at the speed of C.

    program = trace(step, state=..., inputs=..., outputs=...)
    kernel = make_kernel(program)
    states, outputs = kernel.run(pack_states(program.state, start), inputs, steps)

Nothing outside this folder knows how the code is made.
"""

from boresight.lanes.blocks import Kernel, States, from_blocks, make_kernel, pack_states, to_blocks
from boresight.lanes.dual import copysign, gradient, isnan, jacobian, random_pair, reach, select
from boresight.lanes.elementary import near_zero
from boresight.lanes.interpreter import paired
from boresight.lanes.places import BLOCK
from boresight.lanes.program import Leaf, Matrix, Program, Rate, Scalar, Symmetric, Vector, trace
from boresight.lanes.trace import Symbol

__all__ = [
    "BLOCK",
    "Kernel",
    "Leaf",
    "Matrix",
    "Program",
    "Rate",
    "Scalar",
    "States",
    "Symbol",
    "Symmetric",
    "Vector",
    "copysign",
    "from_blocks",
    "gradient",
    "isnan",
    "jacobian",
    "make_kernel",
    "near_zero",
    "pack_states",
    "paired",
    "random_pair",
    "reach",
    "select",
    "to_blocks",
    "trace",
]
