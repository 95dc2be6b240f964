"""One operation of a program as one line of LLVM's language, for one lane or a vector of them."""

from dataclasses import dataclass

from boresight.lanes.philox import KEY_STEPS, MULTIPLIERS, ROUNDS
from boresight.lanes.program import Program, Rate, is_condition

_BINARY = {"add": "fadd contract", "sub": "fsub contract", "mul": "fmul contract"}
_BINARY |= {"div": "fdiv contract", "scale": "fmul"}  # a scaled half turn must stay one: no fusing
_CALLS = {"sqrt": "sqrt", "abs": "fabs", "rint": "rint", "floor": "floor", "copysign": "copysign"}
_CONDITIONS = {"lt": "fcmp olt", "le": "fcmp ole", "isnan": "fcmp uno"}
_LOGIC = {"and": "and", "or": "or"}
_PHILOX = {"philox0": 0, "philox1": 1}
_LOW = 0xFFFFFFFF


@dataclass(frozen=True)
class Shape:
    """What the code is generated for: lanes in one instruction, and the layout of its data."""

    width: int
    rows: bool


@dataclass(frozen=True)
class Kind:
    """LLVM's names for the types of one rate: scalars, or vectors of W lanes."""

    number: str
    integer: str
    bit: str
    suffix: str


def _vector(width: int) -> Kind:
    return Kind(f"<{width} x double>", f"<{width} x i64>", f"<{width} x i1>", f"v{width}")


SCALAR = Kind("double", "i64", "i1", "")


class Writer:
    """Lines of one function, with names for the values already computed."""

    def __init__(self, program: Program, shape: Shape) -> None:
        self.program, self.shape = program, shape
        self.lines: list[str] = []
        self.vector = _vector(shape.width)
        self.splats: dict[int, str] = {}
        self.temporaries = 0
        self.blocks: dict[tuple[int, ...], list[str]] = {}  # random words, by counter and key
        self.kinds = [self.vector if rate & Rate.LANE else SCALAR for rate in program.rates]
        self.elements: dict[str, list[tuple[int, int]]] = {}  # of an input: (element, node)
        for node, (op, args) in enumerate(program.nodes):
            if op == "input":
                self.elements.setdefault(args[0], []).append((args[1], node))

    def emit(self, text: str) -> str:
        """Write an instruction and return the new name of its value."""
        self.temporaries += 1
        name = f"%t{self.temporaries}"
        self.lines.append(f"  {name} = {text}")
        return name

    def line(self, text: str) -> None:
        """Write a line as it is."""
        self.lines.append(text)

    def constant(self, value: str, kind: Kind, scalar: str = "double") -> str:
        """Operand text of a constant."""
        return value if kind is SCALAR else f"splat ({scalar} {value})"

    def value(self, node: int, kind: Kind) -> str:
        """Operand text of a node, splatted if a scalar meets a vector instruction."""
        op, args = self.program.nodes[node]
        if op == "const":
            bits = int.from_bytes(args[0], "little")
            return self.constant(f"0x{bits:016X}", kind)
        if kind is SCALAR or self.kinds[node] is kind:
            return f"%n{node}"
        if node not in self.splats:
            self.splats[node] = self.splat(f"%n{node}", "i1" if is_condition(op) else "double")
        return self.splats[node]

    def splat(self, scalar: str, element: str) -> str:
        """A vector whose every lane is the scalar."""
        w = self.shape.width
        first = self.emit(f"insertelement <{w} x {element}> poison, {element} {scalar}, i64 0")
        kind = f"<{w} x {element}>"
        return self.emit(
            f"shufflevector {kind} {first}, {kind} poison, <{w} x i32> zeroinitializer"
        )

    def compute(self, wanted: Rate) -> None:
        """Emit every operation of one rate, in recorded order."""
        for node, ((op, args), rate) in enumerate(
            zip(self.program.nodes, self.program.rates, strict=True)
        ):
            if rate is wanted and op not in ("const", "input"):
                kind = self.kinds[node]
                self.line(f"  %n{node} = {self.operation(op, args, kind)}")

    def operation(self, op: str, args: tuple[int, ...], kind: Kind) -> str:
        """The right-hand side of an operation."""
        if op in _PHILOX:
            return self.random(args, _PHILOX[op], kind)
        x = [self.value(a, kind) for a in args]
        if op in _BINARY:
            return f"{_BINARY[op]} {kind.number} {x[0]}, {x[1]}"
        if op == "neg":
            return f"fneg {kind.number} {x[0]}"
        if op in _CALLS:
            operands = ", ".join(f"{kind.number} {a}" for a in x)
            return f"call {kind.number} @llvm.{_CALLS[op]}.{kind.suffix}f64({operands})"
        if op in _CONDITIONS:
            return f"{_CONDITIONS[op]} {kind.number} {x[0]}, {x[-1]}"
        if op in _LOGIC:
            return f"{_LOGIC[op]} {kind.bit} {x[0]}, {x[1]}"
        if op == "not":
            return f"xor {kind.bit} {x[0]}, {self.constant('true', kind, 'i1')}"
        if op == "select":
            return f"select {kind.bit} {x[0]}, {kind.number} {x[1]}, {kind.number} {x[2]}"
        return self.bits(op, x[0], kind)

    def bits(self, op: str, x: str, kind: Kind) -> str:
        """Operations on the exponent bits, for whole numbers in range; see elementary.py."""

        def c(value: int) -> str:
            return self.constant(str(value), kind, "i64")

        if op == "pow2":  # adding 2**52 + 1023 leaves x + 1023 in the low bits: no conversion
            magic = self.constant("0x43300000000003FF", kind)
            low = self.emit(f"fadd {kind.number} {x}, {magic}")
            whole = self.emit(f"bitcast {kind.number} {low} to {kind.integer}")
            shifted = self.emit(f"shl {kind.integer} {whole}, {c(52)}")
            return f"bitcast {kind.integer} {shifted} to {kind.number}"
        whole = self.emit(f"bitcast {kind.number} {x} to {kind.integer}")
        if op == "mantissa":
            low = self.emit(f"and {kind.integer} {whole}, {c(0x000FFFFFFFFFFFFF)}")
            one = self.emit(f"or {kind.integer} {low}, {c(0x3FF0000000000000)}")
            return f"bitcast {kind.integer} {one} to {kind.number}"
        exponent = self.emit(f"lshr {kind.integer} {whole}, {c(52)}")
        biased = self.emit(f"or {kind.integer} {exponent}, {c(0x4330000000000000)}")
        number = self.emit(f"bitcast {kind.integer} {biased} to {kind.number}")
        return f"fsub {kind.number} {number}, {self.constant('0x43300000000003FF', kind)}"

    def random(self, args: tuple[int, ...], half: int, kind: Kind) -> str:
        """One number of a random block; its other number shares the work."""
        if (
            args not in self.blocks
        ):  # nodes of equal arguments have equal rates: the first dominates
            self.blocks[args] = self.scrambled([self.value(a, kind) for a in args], kind)
        high, low = self.blocks[args][2 * half : 2 * half + 2]
        left = self.whole("shl", high, 20, kind)
        upper = self.whole("and", left, 0x000FFFFFFFF00000, kind)
        low = self.whole("and", low, _LOW, kind)
        fraction = self.emit(f"or {kind.integer} {upper}, {self.whole('lshr', low, 12, kind)}")
        one = self.whole("or", fraction, 0x3FF0000000000000, kind)
        number = self.emit(f"bitcast {kind.integer} {one} to {kind.number}")
        return f"fsub {kind.number} {number}, {self.constant('0x3FEFFFFFFFFFFFFF', kind)}"

    def scrambled(self, words: list[str], kind: Kind) -> list[str]:
        """Four random words of 32 bits, with anything above those; see philox.py."""
        magic = self.constant("0x4330000000000000", kind)  # 2**52: adding it bares the bits
        bits = [self.emit(f"fadd {kind.number} {word}, {magic}") for word in words]
        *c, k0, k1 = [self.emit(f"bitcast {kind.number} {x} to {kind.integer}") for x in bits]
        for _ in range(ROUNDS):
            p, q = (
                self.whole("mul", self.whole("and", x, _LOW, kind), by, kind)
                for x, by in zip((c[0], c[2]), MULTIPLIERS, strict=True)
            )
            mixed = []
            for product, word, key in ((q, c[1], k0), (p, c[3], k1)):
                keyed = self.emit(f"xor {kind.integer} {word}, {key}")
                high = self.whole("lshr", product, 32, kind)
                mixed.append(self.emit(f"xor {kind.integer} {keyed}, {high}"))
            c = [mixed[0], q, mixed[1], p]
            k0, k1 = (
                self.whole("add", k, step, kind)
                for k, step in zip((k0, k1), KEY_STEPS, strict=True)
            )
        return c

    def whole(self, op: str, x: str, by: int, kind: Kind) -> str:
        """An operation of whole numbers, whose second one is a constant."""
        return self.emit(f"{op} {kind.integer} {x}, {self.constant(str(by), kind, 'i64')}")
