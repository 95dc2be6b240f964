"""Plant faults, one at a time, in a copy of the source, and see whether the laws notice.

    python scripts/mutate.py [--parallel 2] [--only TEXT]

A law that no planted fault breaks is no law. Every fault is a change that a tired person could
make: a sign, a factor, an index, a forgotten square. Each is planted alone in a copy of `src`, and
the fast laws run against that copy in NumPy, stopping at the first failure. Survivors are printed;
the exit code is 1 if fewer than nine in ten are caught.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LAWS = [
    f"tests/laws/test_{name}.py"
    for name in ("linalg", "motions", "components", "linear_world", "textbook", "starts")
]
LAWS += ["tests/laws/test_smoother.py", "tests/laws/test_symmetries.py"]
KERNELS = [f"tests/lanes/test_{name}.py" for name in ("refusals", "program", "elementary")]
KERNELS += ["tests/lanes/test_kernels.py", "tests/laws/test_runs.py", "tests/lanes/test_cache.py"]
COMPILED = ("lanes/", "filters/recursion")
CONVERSIONS = [
    f"tests/{name}.py"
    for name in ("models/test_doppler", "models/test_conversions_rate", "test_errata_bordonaro")
]
CONVERSIONS += ["tests/test_least_squares.py", "tests/interfaces/test_convert.py"]
CONVERSIONS += ["tests/models/test_conversions.py"]
CONVERTED = ("models/conversions", "models/polar", "models/doppler", "filters/least_squares")
CONVERTED += ("interfaces/converting",)
WANTED = 0.9
PATIENCE_S = 900


@dataclass(frozen=True)
class Fault:
    """One planted change: the first occurrence of `old` in `file` becomes `new`."""

    file: str
    old: str
    new: str

    def __str__(self) -> str:
        """File and change in one line."""
        return f"{self.file}: {' '.join(self.old.split())}  ->  {' '.join(self.new.split())}"


def _faults(file: str, *changes: tuple[str, str]) -> Iterator[Fault]:
    return (Fault(file, old, new) for old, new in changes)


FAULTS = (
    *_faults(
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
    *_faults(
        "models/kinematics.py",
        ("factor = factor * dt / (j - i)", "factor = factor * dt"),
        ("total + orders[j] * factor", "total + orders[j]"),
    ),
    *_faults(
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
    *_faults(
        "filters/kalman.py",
        ("F @ prior.cov @ F.T + motion.noise(dt)", "F @ prior.cov @ F.T"),
        ("F @ prior.cov @ F.T", "F.T @ prior.cov @ F"),
        ("S = mirror(H @ cov @ H.T + R)", "S = mirror(H @ cov @ H.T)"),
        ("(1.0 - seen[i])", "0.0 * (1.0 - seen[i])"),
        ("R[i, j] * seen[i] * seen[j]", "(i == j) * R[i, j] * seen[i] * seen[j]"),
        ("[-2.0 * np.log(i)", "[2.0 * np.log(i)"),
        ("mean + K @ nu", "mean - K @ nu"),
        ("white * white", "white"),
        ("value - h @ prior.mean", "value"),
        ("component.sigma * component.sigma", "component.sigma"),
    ),
    *_faults(
        "filters/ekf.py",
        ("gain = cross * (there / s)", "gain = cross / s"),
        ("mean + gain * nu", "mean + cross * nu"),
        ("cov - np.outer(gain, cross)", "cov - np.outer(gain, gain)"),
        ("s = h @ cross + r", "s = h @ cross"),
        ("nu = nu - there * shift", "nu = nu + there * shift"),
        ("gradient(component.value, at)", "gradient(component.value, prior.mean)"),
        ("r = component.sigma * component.sigma + extra", "r = component.sigma * component.sigma"),
        ("squares.append(nu * nu / s)", "squares.append(nu * nu / r)"),
        ("rows.append(h * there)", "rows.append(h)"),
        ("nu - H @ (prior.mean - post.mean)", "nu"),
        ("kalman.condition(prior, moved", "kalman.condition(Gaussian(*post[:2]), moved"),
        ("select(there < 0.5, 1.0, component.sigma", "select(there < 0.5, 0.0, component.sigma"),
    ),
    *_faults(
        "filters/mekf.py",
        ("return distance * mu * 0.5", "return distance * mu"),
        ("(nu * nu - s2)", "(nu * nu + s2)"),
        ("distance * distance * variance * 0.5", "distance * variance * 0.5"),
        ("weight * weight * (s2 * s2)", "weight * (s2 * s2)"),
        ("weight * other * covariance", "weight * weight * covariance"),
        ("distance / 2 * weight * (h @ cov @ h)", "distance * weight * (h @ cov @ h)"),
        ("shift + h @ (latest.mean - prior.mean)", "shift"),
        ("at = prior.mean if", "at = latest.mean if"),
        ("extra if added_variance else 0.0)", "extra)"),
        ("distance * distance * (h @ h)", "h @ h"),
        ("select(bend > 0.0, bend, np.inf)", "bend"),
        ("component.sigma * component.sigma))", "component.sigma))"),
    ),
    *_faults(
        "filters/posterior.py",
        ("seen < 0.5, predicted, measured", "seen < 0.5, 0.0 * predicted, measured"),
        ("return nis, dof, -0.5 *", "return nis, dof, 0.5 *"),
        ("LOG_TWO_PI * dof", "LOG_TWO_PI"),
        ("np.log(2.0 * np.pi)", "np.log(np.pi)"),
    ),
    *_faults(
        "filters/smoother.py",
        ("following.mean - moved", "following.mean - filtered.mean"),
        ("G @ (Q + following.cov) @ G.T", "G @ following.cov @ G.T"),
        ("rest = L - G @ D", "rest = L"),
        ("motion.noise(dt) + found.rest", "motion.noise(dt)"),
        ("abs(pivot) <= _ROUNDING * A[j, j]", "pivot < 0.0"),
        ("np.roll(np.flip(value, axis), 1, axis)", "np.flip(value, axis)"),
        ("there = size < np.inf", "there = size > 0.0"),
    ),
    *_faults(
        "filters/start.py",
        ("spreads[1:] = [np.radians(s) for s in spreads[1:]]", "pass"),
        ("J = np.stack([unit, r[:, None] * across", "J = np.stack([unit, across"),
        ("position @ turn + origin", "position @ turn.T + origin"),
        ("(spread + later) / t[..., None] ** 2", "(spread + later) / t[..., None]"),
    ),
    *_faults(
        "maths/linalg.py",
        ("np.maximum.outer(index, index)]", "np.minimum.outer(index, index)]"),
        ("sum(L[j][k] * L[j][k] for k in range(j))", "sum(L[j][k] for k in range(j))"),
        ("rest * inverse[j]", "rest"),
        ("sum(L[k, i] * x[k] for k in range(i + 1", "sum(L[i, k] * x[k] for k in range(i + 1"),
        ("+ K @ R @ K.T", "- K @ R @ K.T"),
        ("factor * rows[k][j]", "factor"),
    ),
    *_faults(
        "lanes/trace.py",
        ('"mul" and (u == 0 or v == 0)', '"add" and (u == 0 or v == 0)'),
        ("return y if u == 0 else x if v == 0 else None", "return x if u == 0 else None"),
        ("return x if v == 0 else -y if u == 0 else None", "return x if v == 0 else y"),
        ("in _COMMUTE and numbers", 'in ("add", "sub") and numbers'),
        ('_reflected("lt")', '_operator("lt")'),
        ("if value.graph is not self:", "if False:"),
        ("return square * base if half is not None and power % 2 else square", "return square"),
    ),
    *_faults(
        "lanes/dual.py",
        ("0.5 / root", "1.0 / root"),
        ("-np.sin(self.value))", "np.sin(self.value))"),
        ("slopes[i] + s if i in slopes else s", "s"),
        ("other.chain(0.0, quotient * inverse)", "other.chain(0.0, quotient)"),
        ("- x.chain(0.0, self.value * inverse)", "+ x.chain(0.0, self.value * inverse)"),
        ("forbid(Dual)", "pass"),
    ),
    *_faults(
        "lanes/program.py",
        ("rate |= rates[a]", "rate = rates[a]"),
        ("args = tuple([number[a] for a in args])", "pass"),
        ("if program.operations > LARGEST:", "if False:"),
    ),
    *_faults(
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
    *_faults(
        "lanes/ir.py",
        ("@llvm.umin.", "@llvm.umax."),
        ('"%steps" if s.rate == Rate.EACH else "1"', '"%steps"'),
        ('moved = w.emit(f"mul i64 %t, {size * BLOCK}")', 'moved = w.emit("mul i64 %t, 8")'),
        ("[ {following}, %step ]", "[ {old[node]}, %step ]"),
    ),
    *_faults(
        "lanes/writer.py",
        ('"le": "fcmp ole"', '"le": "fcmp olt"'),
        ('"isnan": "fcmp uno"', '"isnan": "fcmp ord"'),
        ('"fdiv contract"', '"fdiv fast"'),
    ),
    *_faults(
        "lanes/blocks.py",
        ("parts + 1)]", "parts)] + [chunks - 1]"),
        ("new = np.empty_like(states.data)", "new = states.data"),
        ("if steps < 1 or threads < 1:", "if False:"),
        ("if array.shape != expected:", "if False:"),
    ),
    *_faults(
        "lanes/simd.py",
        ("if code and hashlib.sha256(code).digest() == checksum else None", ""),
        ("resources = _LOADED.get(name)", "resources = None"),
        ("{cpu} {goal.features} O1", "O1"),
        ("except RuntimeError:  # an account", "except KeyError:  # an account"),
    ),
    *_faults(
        "filters/recursion.py",
        ("finite = total < np.inf", "finite = total * 0.0 < 1.0"),
        ("for pivot in pivots[1:]:", "for pivot in pivots[1:0]:"),
    ),
    *_faults(
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
    *_faults(
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
    *_faults(
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
    *_faults(
        "models/doppler.py",
        ("closing_mps - speed_mps", "closing_mps + speed_mps"),
        ("speed_mps * speed_mps * ahead", "speed_mps * ahead"),
        ("[1.0, *given.mean[1:]]", "given.mean"),
        ("/ (2.0 * transmitted_hz)", "/ transmitted_hz"),
    ),
    *_faults(
        "filters/least_squares.py",
        ("np.linalg.inv(R) * ~gone[..., None, None]", "np.linalg.inv(R)"),
        ("np.linalg.solve(total, pulled[..., None])", "(total @ pulled[..., None])"),
    ),
    *_faults(
        "interfaces/converting.py",
        ("turn.mT @ cov @ turn)", "turn @ cov @ turn.mT)"),
        ("mean - pose.position_m[..., :d]", "mean"),
        ("cov + 0.0 * z.sum(0)", "cov"),
    ),
    *_faults(
        "maths/angles.py",
        ("TURN = 2 * np.pi", "TURN = np.pi"),
        ("TURN * np.floor(0.5 - angle / TURN)", "0.0 * angle"),
    ),
)  # fmt: skip


def caught(fault: Fault) -> bool:
    """Whether the laws fail against a copy of the source with this fault."""
    with tempfile.TemporaryDirectory(prefix="mutant-") as folder:
        copy = Path(folder) / "src"
        shutil.copytree(ROOT / "src", copy, ignore=shutil.ignore_patterns("__pycache__", "demo"))
        path = copy / "boresight" / fault.file
        text = path.read_text(encoding="utf-8")
        if fault.old not in text:
            raise SystemExit(f"the fault list is out of date: not found in {fault}")
        path.write_text(text.replace(fault.old, fault.new, 1), encoding="utf-8")
        return not laws_hold(copy, laws_of(fault))


def laws_of(fault: Fault) -> list[str]:
    """The tests that judge a fault: of the compiler, of conversions, or of everything else."""
    if fault.file.startswith(COMPILED):
        return KERNELS
    return CONVERSIONS if fault.file.startswith(CONVERTED) else LAWS


def laws_hold(source: Path, laws: list[str]) -> bool:
    """Whether the laws hold for a source tree; a crash counts as a broken law, and so does a hang.

    Args:
        source: folder that holds the package.
        laws: tests; formulas are judged in NumPy, the compiler by what it compiles.
    """
    options = ["-n0", "-x", "-q", "--no-header", "--tb=no", "-p", "no:cacheprovider"]
    with tempfile.TemporaryDirectory(prefix="kernels-") as cache:
        environment = {"PYTHONPATH": str(source), "PYTHONDONTWRITEBYTECODE": "1"}
        environment |= {"HYPOTHESIS_PROFILE": "mutants", "BORESIGHT_CACHE": cache}
        environment |= {} if laws is KERNELS else {"BORESIGHT_TARGET": "numpy"}
        try:
            done = subprocess.run(  # noqa: S603 - our own tests
                [sys.executable, "-m", "pytest", *options, *laws],
                cwd=ROOT, env=os.environ | environment, capture_output=True, text=True,
                check=False, timeout=PATIENCE_S,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return False
    if done.returncode > 1:
        raise SystemExit(f"the laws did not run:\n{done.stdout}{done.stderr}")
    return done.returncode == 0


def main() -> int:
    """Plant every fault and report."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--parallel", type=int, default=2)
    parser.add_argument("--only", default="", help="faults whose text contains this")
    options = parser.parse_args()
    chosen = [fault for fault in FAULTS if options.only in str(fault)]
    needed = {id(laws): laws for laws in map(laws_of, chosen)}
    if not all(laws_hold(ROOT / "src", laws) for laws in needed.values()):
        raise SystemExit("the laws do not hold without any fault planted")
    with ThreadPoolExecutor(options.parallel) as pool:
        results = pool.map(caught, chosen)
        survivors = []
        for fault, found in zip(chosen, results, strict=True):
            print("caught  " if found else "SURVIVED", fault, flush=True)
            survivors += [] if found else [fault]
    share = 1 - len(survivors) / len(chosen)
    print(f"{len(chosen) - len(survivors)} of {len(chosen)} faults caught ({100 * share:.0f} %)")
    return 0 if share >= WANTED else 1


if __name__ == "__main__":
    sys.exit(main())
