"""Numbers with units become what the models take, exactly; others say what is possible."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.laboratory import quantities as q

# By hand: definitions of the foot (0.3048 m), yard (0.9144 m), nautical mile (1852 m), knot
# (1852 m an hour) and standard gravity (9.80665 m/s²).
EXACT = [
    ("30 m", q.LENGTH, 30.0),
    ("100 ft", q.LENGTH, 30.48),
    ("3 NM", q.LENGTH, 5556.0),
    ("2.5 km", q.LENGTH, 2500.0),
    ("1 yd", q.LENGTH, 0.9144),
    ("1_000m", q.LENGTH, 1000.0),
    ("1e3 m", q.LENGTH, 1000.0),
    ("-.5 m", q.LENGTH, -0.5),
    ("0.5 deg", q.ANGLE, 0.5),
    ("  0.5   deg ", q.ANGLE, 0.5),
    ("0.1°", q.ANGLE, 0.1),
    ("3.6 km/h", q.SPEED, 1.0),
    ("450 kn", q.SPEED, 231.5),
    ("450 kt", q.SPEED, 231.5),
    ("6000 ft/min", q.SPEED, 30.48),
    ("2 m/s^2", q.ACCELERATION, 2.0),
    ("2 m/s²", q.ACCELERATION, 2.0),
    ("1 g", q.ACCELERATION, 9.80665),
    ("4 s", q.TIME, 4.0),
    ("250 ms", q.TIME, 0.25),
    ("5 %", q.SHARE, 0.05),
    (0.05, q.SHARE, 0.05),
    (1, q.SHARE, 1.0),
    ("3 deg/s", q.TURN_RATE, 3.0),
]


@pytest.mark.parametrize(("text", "kind", "value"), EXACT)
def test_a_quantity_is_what_it_says(text, kind, value):
    assert q.quantity(text, kind) == value


def test_a_radian_is_what_the_library_says_to_a_rounding():
    assert q.quantity("1 rad", q.ANGLE) == math.degrees(1.0)
    assert q.quantity("1 mrad", q.ANGLE) == pytest.approx(math.degrees(1e-3), rel=1e-15)


@pytest.mark.parametrize(
    ("value", "kind", "what", "hint"),
    [
        (30, q.LENGTH, "has no unit", "m, km, ft, yd, NM"),
        (30.5, q.ANGLE, "has no unit", "deg"),
        ("30", q.LENGTH, "has no unit", "30 m"),
        ("30 m", q.ANGLE, "is a length, not an angle", "deg"),
        ("0.5 furlong", q.LENGTH, "unit that is not known", "NM"),
        ("m", q.LENGTH, "is not a length", "30 m"),
        ("", q.LENGTH, "is not a length", "30 m"),
        ("1 2 m", q.LENGTH, "is not a length", "30 m"),
        ("nan m", q.LENGTH, "is not a length", "30 m"),
        ("1e999 m", q.LENGTH, "too large", "finite"),
        ("1e99999999 m", q.LENGTH, "unit that is not known|is not a length", "m"),
        ("9" * 1000 + " m", q.LENGTH, "is not a length", "30 m"),
        (True, q.LENGTH, "is not a length", "30 m"),
        (True, q.SHARE, "is not a share", "%"),
        (float("nan"), q.SHARE, "is not a share", "%"),
        (None, q.TIME, "is not a time", "4 s"),
        (["4 s"], q.TIME, "is not a time", "4 s"),
    ],
)
def test_what_is_no_quantity_says_what_is_possible(value, kind, what, hint):
    with pytest.raises(ValueError, match=what) as found:
        q.quantity(value, kind)
    assert hint in found.value.args[1]


@given(st.floats(-1e12, 1e12), st.sampled_from(q.KINDS))
def test_the_models_own_unit_changes_nothing(value, kind):
    assert q.quantity(f"{value!r} {kind.unit}", kind) == value


@given(st.text(max_size=80), st.sampled_from(q.KINDS))
def test_any_text_is_a_number_or_a_sentence(text, kind):
    try:
        found = q.quantity(text, kind)
    except ValueError as error:
        found, *_ = (0.0, *error.args)
    assert math.isfinite(found)
