"""A user's filter: an object wherever a name is taken, or offered by an installed package."""

import subprocess
import sys
import tomllib
import zipfile
from itertools import count

import numpy as np
import pytest

import boresight as bs
from boresight import catalogue
from boresight.filters import plugins
from boresight.testing.worlds import UPRIGHT
from own_filters import EXAMPLE, FADING_EKF, NUMPY_EKF, Whispering, update

WORLD = UPRIGHT[1]
RADAR, MOTION = WORLD.sensor, WORLD.motion
_NUMBER = count()


@pytest.fixture
def offer(tmp_path, monkeypatch):
    """Installs a package in a folder of its own: its text, and what it offers by name."""

    def install(offers, text="", *, package="", version="1.0"):
        number = next(_NUMBER)
        package, module = package or f"some-package-{number}", f"offered_{number}"
        folder = tmp_path / str(number)
        info = folder / f"{package.replace('-', '_')}-{version}.dist-info"
        info.mkdir(parents=True)
        (folder / f"{module}.py").write_text(text, encoding="utf-8")
        (info / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {package}\nVersion: {version}\n", encoding="utf-8"
        )
        lines = [f"{name} = {module}:{what}" for name, what in offers.items()]
        (info / "entry_points.txt").write_text(
            "\n".join([f"[{plugins.GROUP}]", *lines]), encoding="utf-8"
        )
        monkeypatch.syspath_prepend(str(folder))
        return package

    return install


GOOD = (EXAMPLE / "fading_ekf.py").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["fading_ekf", "numpy_ekf"])
def test_a_filter_is_thirty_lines_at_most(name):
    assert len((EXAMPLE / f"{name}.py").read_text(encoding="utf-8").splitlines()) <= 30


def plots():
    scenario = bs.Scenario(
        name="two targets",
        motion=MOTION,
        sensor=RADAR,
        initial=[2e4, 1e4, -100, 20],
        prior_cov=np.diag([100.0**2] * 2 + [10.0**2] * 2),
        scans=12,
    )
    return bs.simulate(scenario, RADAR, runs=4, seed=1)[1]


def same(one, other):
    for name in ("mean", "cov"):
        expected = getattr(other, name)
        np.testing.assert_allclose(
            getattr(one, name), expected, rtol=0, atol=1e-9 * np.max(np.abs(expected))
        )


@pytest.mark.parametrize(
    "given", [FADING_EKF, update, NUMPY_EKF], ids=["filter", "formula", "function"]
)
@pytest.mark.parametrize("start", [None, "one plot", "two plots"])
def test_run_takes_it_and_it_is_the_sequential_ekf(given, start):
    heard = plots()
    expected = bs.run("ekf-sequential", MOTION, RADAR, heard, start=start, order=RADAR.names)
    same(bs.run(given, MOTION, RADAR, heard, start=start), expected)


def test_a_function_s_last_scan_is_the_last_of_all():
    heard = plots()
    every = bs.run(NUMPY_EKF, MOTION, RADAR, heard)
    last = bs.run(NUMPY_EKF, MOTION, RADAR, heard, last=True)
    np.testing.assert_array_equal(last.mean, every.mean[:, -1])
    assert bs.smooth(every, MOTION).mean.shape == every.mean.shape


def test_a_setting_of_its_own_is_a_setting():
    heard = plots()
    faded = bs.run(FADING_EKF, MOTION, RADAR, heard, fading=1.5)
    plain = bs.run(FADING_EKF, MOTION, RADAR, heard)
    assert np.all(np.linalg.det(faded.cov[:, -1]) > np.linalg.det(plain.cov[:, -1]))
    with pytest.raises(bs.UsageError, match="use fading"):
        bs.run(FADING_EKF, MOTION, RADAR, heard, facing=1.5)


def test_stream_takes_it():
    heard = plots()
    step = bs.stream(FADING_EKF, MOTION, RADAR)
    state = step.start(bs.Gaussian(heard.prior.mean[0], heard.prior.cov))
    for z, dt in zip(heard.z[0], heard.dt[0], strict=True):
        state = step(state, z, dt=dt)
    found = bs.run(FADING_EKF, MOTION, RADAR, heard)
    np.testing.assert_allclose(state.mean, found.mean[0, -1], rtol=1e-12)


@pytest.mark.parametrize("how", ["filter", "compare"])
def test_track_takes_it(how, demo_plots):
    chosen = {"filter": FADING_EKF} if how == "filter" else {"compare": [FADING_EKF]}
    tracks = bs.track(demo_plots, **chosen)
    assert "fading-ekf" in (
        [tracks.filter] if how == "filter" else [r.filter for r in tracks.filters]
    )


@pytest.fixture(scope="module")
def demo_plots():
    from importlib import resources

    with resources.as_file(resources.files("boresight") / "demo" / "recording.ast") as path:
        read = bs.read(path)
    return read.filter(read["time_s"] < read["time_s"].min() + 600)


def test_an_installed_package_s_filter_is_a_name(offer):
    package = offer({"fading-ekf": "FADING_EKF"}, GOOD)
    assert catalogue.names() == (*catalogue.OWN, "fading-ekf")
    heard = plots()
    expected = bs.run(FADING_EKF, MOTION, RADAR, heard)
    np.testing.assert_array_equal(bs.run("fading-ekf", MOTION, RADAR, heard).mean, expected.mean)
    with pytest.raises(bs.UsageError, match="did you mean 'fading-ekf'"):
        bs.run("fadin-ekf", MOTION, RADAR, heard)
    with pytest.raises(bs.UsageError, match="names no paper"):
        bs.cite("fading-ekf")
    assert package


def test_a_bare_formula_may_be_offered_too(offer):
    offer({"my-own": "update"}, GOOD)
    assert catalogue.lookup("my-own").name == "my-own"


BROKEN = {
    "cannot be imported": (
        {"bad": "x"},
        "import nonsense_that_is_not_there",
        "ModuleNotFoundError",
    ),
    "is not there": ({"bad": "absent"}, "", "AttributeError"),
    "fails": ({"bad": "x"}, "x = 1 / 0", "ZeroDivisionError"),
    "is none": ({"bad": "x"}, "x = 3", "offers as 'bad' is no filter\n  why: +it is a int"),
    "is called otherwise": ({"bad": "FADING_EKF"}, GOOD, "calls itself 'fading-ekf'"),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_a_broken_package_is_named_and_harms_nobody(offer, fault):
    offers, text, said = BROKEN[fault]
    package = offer(offers, text)
    offer({"good": "update"}, GOOD)
    with pytest.raises(bs.UsageError, match=said) as caught:
        catalogue.lookup("bad")
    assert package in str(caught.value)
    assert catalogue.lookup("good").name == "good"
    assert catalogue.lookup("mekf").name == "mekf"
    assert set(catalogue.names()) == {*catalogue.OWN, "good", "bad"}


def test_a_name_that_is_ours_stays_ours(offer):
    package = offer({"mekf": "x", "fine": "update"}, GOOD)
    with pytest.warns(UserWarning, match=f"'mekf' of {package} is not used"):
        assert catalogue.names() == (*catalogue.OWN, "fine")
    assert catalogue.lookup("mekf").paper == "kashyap"


def test_a_name_that_two_packages_offer_is_neither_s(offer):
    first, second = (offer({"twice": "update"}, GOOD) for _ in range(2))
    with pytest.raises(bs.UsageError, match="offered more than once") as caught:
        catalogue.lookup("twice")
    assert first in str(caught.value)
    assert second in str(caught.value)


def test_our_own_names_ask_nobody(monkeypatch):
    def asked(_):
        raise AssertionError("packages were listed")

    monkeypatch.setattr(plugins, "offered", asked)
    assert all(catalogue.lookup(name).name == name for name in catalogue.OWN)


WRONG = {
    "no name": (lambda: bs.Filter(name="", formula=update), "no name of a filter"),
    "a list": (lambda: bs.Filter(name="a,b", formula=update), "no name of a filter"),
    "no formula": (lambda: bs.Filter(name="a", formula=3), "is a int"),
    "too few": (
        lambda: bs.Filter(name="a", formula=lambda x: x),
        "does not take prior, z and comp",
    ),
    "no function": (lambda: bs.Outside(name="a", function=None), "is a NoneType"),
    "a number": (lambda: bs.run(3, MOTION, RADAR, plots()), "there is no filter 3"),
    "no steps": (lambda: bs.stream(NUMPY_EKF, MOTION, RADAR), "no step of it to run"),
    "a setting": (lambda: bs.run(NUMPY_EKF, MOTION, RADAR, plots(), a=1), "has no setting 'a'"),
    "an output": (
        lambda: bs.run(NUMPY_EKF, MOTION, RADAR, plots(), outputs=["loglik"]),
        "numpy-ekf tells no 'loglik'",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_filter_is_refused(name):
    call, said = WRONG[name]
    with pytest.raises(bs.UsageError, match=said):
        call()


def test_a_class_of_method_needs_no_prediction():
    assert bs.Filter(name="a", formula=Whispering).predict is None


def writing(z, *_):
    z[:] = 0.0


def failing(*_):
    raise ValueError("no such plot")


def short(z, dt, start, motion, sensor):
    mean, cov = NUMPY_EKF.function(z, dt, start, motion, sensor)
    return mean[:, :-1], cov


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (writing, "ValueError: .*read-only"),
        (failing, "ValueError: no such plot"),
        (short, r"gives mean \(4, 11, 4\)"),
        (lambda *_: None, "'odd' failed: TypeError"),
    ],
)
def test_a_function_that_fails_says_so(function, said):
    with pytest.raises(bs.UsageError, match=said):
        bs.run(bs.Outside(name="odd", function=function), MOTION, RADAR, plots())


def wheel(folder):
    """What a build of the example gives: a wheel with its modules and its entry points."""
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = project["entry-points"][plugins.GROUP].items()
    stem = f"own_filter-{project['version']}"
    info, version = f"{stem}.dist-info", project["version"]
    texts = {path.name: path.read_text(encoding="utf-8") for path in EXAMPLE.glob("*.py")} | {
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: own-filter\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{info}/entry_points.txt": "\n".join(
            [f"[{plugins.GROUP}]", *(f"{name} = {what}" for name, what in lines)]
        ),
    }
    record = "".join(f"{name},,\n" for name in [*texts, f"{info}/RECORD"])
    path = folder / f"{stem}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in (texts | {f"{info}/RECORD": record}).items():
            archive.writestr(name, text)
    return path


@pytest.mark.slow
def test_the_example_is_installed_and_its_filters_are_names(tmp_path):
    target = tmp_path / "site"
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*install, "--target", str(target), str(wheel(tmp_path))], check=True)
    code = (
        f"import sys; sys.path.append({str(target)!r})\n"
        "import boresight as bs; from boresight import catalogue\n"
        "assert catalogue.names() == (*catalogue.OWN, 'fading-ekf', 'numpy-ekf')\n"
        "print(*bs.testing.check('fading-ekf').laws, sep=',')\n"
        "print(*bs.testing.check('numpy-ekf', law='kalman').worlds, sep=',')\n"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        ",".join(law.name for law in bs.testing.laws()),
        "positions in space,positions in the plane",
    ]


STUDY = {
    "scenario": {"kind": "paper", "name": "kashyap-set-4"},
    "filter": [{"name": "ekf-sequential", "order": ["range_m", "azimuth_rad"]}],
    "runs": 12,
    "seed": 5,
}


def rmse_of(result):
    return {cell.label: cell.position_rmse_m.value for cell in result.cells}


def test_compare_takes_it():
    found = rmse_of(bs.compare(STUDY, filters=[FADING_EKF, NUMPY_EKF]))
    assert found["fading-ekf"] == pytest.approx(found["ekf-sequential"], rel=1e-6)
    assert found["numpy-ekf"] == pytest.approx(found["ekf-sequential"], rel=1e-6)


def test_a_study_names_what_a_package_offers(offer):
    offer({"fading-ekf": "FADING_EKF"}, GOOD)
    offer({"numpy-ekf": "NUMPY_EKF"}, (EXAMPLE / "numpy_ekf.py").read_text(encoding="utf-8"))
    tables = [
        {"name": "fading-ekf"},
        {"name": "fading-ekf", "label": "faded", "fading": 1.2},
        {"name": "numpy-ekf"},
    ]
    found = rmse_of(bs.compare(STUDY | {"filter": tables}))
    assert found["fading-ekf"] == pytest.approx(found["numpy-ekf"], rel=1e-6)
    assert found["faded"] > found["fading-ekf"]
