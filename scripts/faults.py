"""Planted faults: each a change that a tired person could make; `mutate.py` sees who notices."""

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """One planted change: the first occurrence of `old` in `file` becomes `new`."""

    file: str
    old: str
    new: str

    def __str__(self) -> str:
        """File and change in one line."""
        return f"{self.file}: {' '.join(self.old.split())}  ->  {' '.join(self.new.split())}"


def faults(file: str, *changes: tuple[str, str]) -> Iterator[Fault]:
    """Changes of one file."""
    return (Fault(file, old, new) for old, new in changes)


FAULTS = (
    *faults(
        "models/components.py",
        ("_FLOOR = 1e-6", "_FLOOR = 0.0"),
        ("select(square < _FLOOR, _FLOOR, square)", "square"),
        ("np.arctan2(y, x)", "np.arctan2(x, y)"),
        ("np.arctan2(y, x)", "np.arctan2(y, abs(x))"),
        ("select(on_axis, 1e-3, p[0])", "p[0]"),
        ("_root(p[0] * p[0] + p[1] * p[1]))", "range_m(p, v))"),
        ("zip(p, v, strict=True)) / range_m(p, v)", "zip(p, v, strict=True))"),
        ("return wrap(difference) if self.is_angle else difference", "return difference"),
        ("return wrap(difference) if self.is_angle else difference", "return wrap(difference)"),
        ("measured - predicted", "predicted - measured"),
    ),
    *faults(
        "models/kinematics.py",
        ("factor = factor * dt / (j - i)", "factor = factor * dt"),
        ("total + orders[j] * factor", "total + orders[j]"),
    ),
    *faults(
        "models/motion.py",
        ("[[q * dt**3 / 3, q * dt**2 / 2]", "[[q * dt**3 / 2, q * dt**2 / 2]"),
        ("[[q * dt**4 / 4, q * 0.0]", "[[q * dt**4 / 4, q * dt**3 / 2]"),
        ("[[q * dt**4 / 4, q * dt**3 / 2]", "[[q * dt**4 / 2, q * dt**3 / 2]"),
        ("[q * dt**5 / 20, q * dt**4 / 8, q * dt**3 / 6]", "[q * dt**5 / 20] * 3"),
        ("q * dt**3 / 6, q * dt**2 / 2, q * dt]", "q * dt**3 / 6, q * dt**2 / 2, q * dt**2]"),
        ("half = w * dt / 2.0", "half = w * dt"),
        ("1.0 - half * half / 6.0", "1.0 - half * half / 3.0"),
        ("x + chord * (c * vx - s * vy)", "x + chord * (c * vx + s * vy)"),
        ("cos = 2.0 * s * c, 1.0 - 2.0 * s * s", "cos = 2.0 * s * c, 1.0 - s * s"),
        ("* (np.pi / 180.0) * dt", "* dt"),
        ("x / r - y - x * z / ground,", "x / r + y - x * z / ground,"),
        ("- 2 * x * z / ground,  # (14)", "+ 2 * x * z / ground,  # (14)"),
        ("q = self.accel_mps2 * self.accel_mps2", "q = self.accel_mps2"),
    ),
    *faults(
        "maths/linalg.py",
        ("np.maximum.outer(index, index)]", "np.minimum.outer(index, index)]"),
        ("sum(L[j][k] * L[j][k] for k in range(j))", "sum(L[j][k] for k in range(j))"),
        ("rest * inverse[j]", "rest"),
        ("sum(L[k, i] * x[k] for k in range(i + 1", "sum(L[i, k] * x[k] for k in range(i + 1"),
        ("+ K @ R @ K.T", "- K @ R @ K.T"),
        ("factor * rows[k][j]", "factor"),
    ),
    *faults(
        "lanes/trace.py",
        ('"mul" and (u == 0 or v == 0)', '"add" and (u == 0 or v == 0)'),
        ("return y if u == 0 else x if v == 0 else None", "return x if u == 0 else None"),
        ("return x if v == 0 else -y if u == 0 else None", "return x if v == 0 else y"),
        ("in _COMMUTE and numbers", 'in ("add", "sub") and numbers'),
        ('_reflected("lt")', '_operator("lt")'),
        ("if value.graph is not self:", "if False:"),
        ("return square * base if half is not None and power % 2 else square", "return square"),
    ),
    *faults(
        "lanes/dual.py",
        ("0.5 / root", "1.0 / root"),
        ("-np.sin(self.value))", "np.sin(self.value))"),
        ("slopes[i] + s if i in slopes else s", "s"),
        ("other.chain(0.0, quotient * inverse)", "other.chain(0.0, quotient)"),
        ("- x.chain(0.0, self.value * inverse)", "+ x.chain(0.0, self.value * inverse)"),
        ("forbid(Dual)", "pass"),
    ),
    *faults(
        "lanes/program.py",
        ("rate |= rates[a]", "rate = rates[a]"),
        ("args = tuple([number[a] for a in args])", "pass"),
        ("if program.operations > LARGEST:", "if False:"),
    ),
    *faults(
        "lanes/elementary.py",
        ("n * _HALF_PI[0]) - n * _HALF_PI[1]", "n * _HALF_PI[0]) - n * 0.0"),
        ("select(abs(x) < 1e-8, x, signed)", "signed"),
        ("abs(x) <= LARGEST_ANGLE", "abs(x) <= 1e300"),
        ("select(x > 709.8, 709.8, x)", "x"),
        ("e * _LN2[1]", "e * 0.0"),
        ("select(behind, math.pi - angle, angle)", "angle"),
        ("(low - inverse)", "(low - 1.0)"),
        ("select(abs(x) < 1e-20, x, value)", "value"),
        ("copysign((a + _BIG) - _BIG, x)", "((a + _BIG) - _BIG)"),
        ("select(x < nearest, 1.0, 0.0)", "0.0"),
    ),
    *faults(
        "lanes/ir.py",
        ("@llvm.umin.", "@llvm.umax."),
        ("[ {following}, %step ]", "[ {old[node]}, %step ]"),
    ),
    *faults(
        "lanes/places.py",
        ('moved = w.emit(f"mul i64 %t, {size * BLOCK}")', 'moved = w.emit("mul i64 %t, 8")'),
    ),
    *faults(
        "lanes/outputs.py",
        ('"%steps" if slot.rate == Rate.EACH else "1"', '"%steps"'),
        ('return w.emit(f"mul i64 %chunk, {numbers}")', 'return "0"'),
    ),
    *faults(
        "lanes/writer.py",
        ('"le": "fcmp ole"', '"le": "fcmp olt"'),
        ('"isnan": "fcmp uno"', '"isnan": "fcmp ord"'),
        ('"fdiv contract"', '"fdiv fast"'),
    ),
    *faults(
        "lanes/blocks.py",
        ("parts + 1)]", "parts)] + [chunks - 1]"),
        ("new = np.empty_like(states.data)", "new = states.data"),
        ("if steps < 1 or threads < 1:", "if False:"),
        ("if array.shape != expected:", "if False:"),
    ),
    *faults(
        "lanes/simd.py",
        ("if code and hashlib.sha256(code).digest() == checksum else None", ""),
        ("resources = _LOADED.get(name)", "resources = None"),
        ("{cpu} {goal.features} O1", "O1"),
        ("except RuntimeError:  # an account", "except KeyError:  # an account"),
    ),
    *faults(
        "models/polar.py",
        ("np.expm1(-0.5 * variance)", "np.expm1(-variance)"),
        ("blur = -0.5 * fade", "blur = -fade"),
        ("sharp = 1.0 - 2.0 * blur", "sharp = 1.0 - blur"),
        ("sharp * sin * sin + blur", "sharp * sin * sin"),
        ("distance * distance + spread", "distance * distance"),
        ("trig[2 * i], trig[2 * i + 1], v", "trig[0], trig[1], v"),
        ("growth = np.expm1(variance)", "growth = np.exp(variance) - 1.0"),
        ("lift = 0.5 * growth * growth * inverse", "lift = growth * growth * inverse"),
        ("growth * inverse / (1.0 + shrink)", "growth * inverse"),
        ("growth - lift, growth)", "growth + lift, growth)"),
        ("2.0 * sum(v[i] * v[j]", "sum(v[i] * v[j]"),
        ("[-sin, cos]) * inverse * inverse", "[-sin, cos]) * inverse"),
        ("select(on_axis, 1e-3, x)", "x"),
        ("[-cos * high, -sin * high, low]", "[cos * high, sin * high, low]"),
    ),
    *faults(
        "models/conversions.py",
        ("along * sin2 + across * cos2", "along * cos2 + across * sin2"),
        ("(along - across) * product", "(along + across) * product"),
        ("tilt * cos, tilt * sin", "tilt * sin, tilt * cos"),
        ("low = p.lift * cos2 + p.sinh * sin2", "low = p.sinh * cos2 + p.lift * sin2"),
        ("(1.0 + t.lift) * low + t.lift", "low + t.lift"),
        ("(square + sr2) * t.sinh", "square * t.sinh"),
        ("t.sinh * (cos2 + low)", "t.sinh * cos2"),
        ("p.shrink * p.shrink * (sr2", "p.shrink * (sr2"),
        ("(sr2 - square * p.growth)", "(sr2 + square * p.growth)"),
        ("sheet.tilt * ground * up", "sheet.tilt * square"),
        ("[u + b for u, b", "[u - b for u, b"),
        ("Given(plot.z, plot.variances)", "Given(plot.z, [0.0] * len(plot.z))"),
        ("1.0 / ground, 1.0 / up", "ground, up"),
        ("loss * (1.0 + kept) / kept", "loss / kept"),
        ("_sum(_posterior(plot), squared)", "_posterior(plot)"),
        ("total, elevation = where.square + plot.variances[0]", "total, elevation = where.square"),
        ("lost + kept * rest", "lost"),
        ("[eta * kept for kept", "[kept for kept"),
        ("return _unbiased(plot, None)", "return _modified_unbiased(plot, None)"),
        ("    where = place(given)\n    return", "    where = plot.at\n    return"),
        ("t.loss + p.loss * t.shrink", "t.loss + p.loss"),
        ("[s * s for s in sigma]", "[s for s in sigma]"),
        ("across=square * sa2 * e.cos2", "across=square * sa2"),
        ("(t.shrink * p.shrink, p.shrink)", "(t.shrink, p.shrink)"),
    ),
    *faults(
        "models/conversions_rate.py",
        ("noise.range * noise.rate + noise.both * noise.both", "noise.range * noise.rate"),
        ("2.0 * cross * noise.both", "cross * noise.both"),
        ("rate * noise.range + where.range * noise.both", "rate * noise.range"),
        ("lag = -2.0 * noise.both", "lag = -noise.both"),
        ("rate * rate + spread", "rate * rate"),
        ("where.range * rate + shared", "where.range * rate"),
        ("z[0] * z[-1] - noise.both", "z[0] * z[-1]"),
        ("(v - rate * a) / found.mean[0]", "v / found.mean[0]"),
    ),
    *faults(
        "models/doppler.py",
        ("closing_mps - speed_mps", "closing_mps + speed_mps"),
        ("speed_mps * speed_mps * ahead", "speed_mps * ahead"),
        ("[1.0, *given.mean[1:]]", "given.mean"),
        ("/ (2.0 * transmitted_hz)", "/ transmitted_hz"),
    ),
    *faults(
        "interfaces/converting.py",
        ("turn.mT @ cov @ turn)", "turn @ cov @ turn.mT)"),
        ("mean - pose.position_m[..., :d]", "mean"),
        ("cov + 0.0 * z.sum(0)", "cov"),
    ),
    *faults(
        "maths/angles.py",
        ("TURN = 2 * np.pi", "TURN = np.pi"),
        ("TURN * np.floor(0.5 - angle / TURN)", "0.0 * angle"),
    ),
)  # fmt: skip
