"""Planted faults: in the laws that users hold their filters to, and in how theirs are found."""

from faults import faults

JUDGES = {
    "testing/": ("test_laws_for_users",),
    "filters/plugins": ("test_outside_filters",),
    "filters/method": ("test_outside_filters",),
}
FAULTS = (
    *faults(
        "testing/comparing.py",
        ("if not gap <= rtol * size", "if gap < 0"),
        ("not np.array_equal(found, expected, equal_nan=True)", "False"),
        ('near("the mean", one.mean', 'near("the mean", other.mean'),
    ),
    *faults(
        "testing/symmetries.py",
        ("further[[name in ANGLES for name in world.sensor.names]] += turns * 2 * np.pi", "pass"),
        ("back = tuple(reversed(", "back = tuple(("),
        ("nothing, models = np.full(len(z), np.nan)", "nothing, models = z"),
        ("        gap[i] = np.nan", "        return"),
        ("position_m=T @ before.position_m + shift", "position_m=before.position_m"),
        ("if smallest <= 0:", "if smallest <= -1e9:"),
        (
            "    subject.run(world, mean, cov, z[None], dt)\n    subject.update",
            "    subject.update",
        ),
    ),
    *faults(
        "testing/lanes.py",
        ("post.mean, many.mean[lane, -1], 1e-9", "post.mean, post.mean, 1e-9"),
        ('near(f"{name} at scan {t}", told, many.others[name][:, t], rtol)', "pass"),
        ("many.others[name][lane, t], results[name], 2e-9", "results[name], results[name], 2e-9"),
    ),
    *faults(
        "testing/laws.py",
        ("for case in range(self.cases) if seed is None else (seed,)", "for case in range(0)"),
        ("if refusal(subject, world) is None", "if True"),
        ("if self.of_steps and isinstance(subject, Whole)", "if False"),
    ),
    *faults(
        "testing/consistent.py",
        ("if not each.low <= each.value <= each.high", "if each.value > 2.0"),
        ("found.value > found.high", "found.value < found.high"),
        ("if len(runs) < FEWEST_RUNS:", "if False:"),
    ),
    *faults(
        "filters/plugins.py",
        (
            "for name, points in found.items() if name not in taken",
            "for name, points in found.items()",
        ),
        ("if len(points) > 1:", "if False:"),
        ("except Exception as error:", "except ImportError as error:"),
        ("if name and value.name != name:", "if False:"),
        ("(*found.get(point.name, ()), point)", "(point,)"),
    ),
    *faults(
        "filters/method.py",
        ("view.flags.writeable = False", "pass"),
        ("_taken_by_position(self.formula) != 3", "False"),
        ('object.__setattr__(self, "predict", None)', "pass"),
        ("(said.mean.shape, said.cov.shape) != (expected", "() != () and (expected"),
    ),
)
