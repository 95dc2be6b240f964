"""Numbers and text into the bit fields of an item: the inverse of reading them."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UsageError
from boresight.formats.specs import Field, Shape
from boresight.formats.wire import Flags, Octets

_SIX_BIT = {" ": 32} | {chr(64 + n): n for n in range(1, 27)} | {str(n): 48 + n for n in range(10)}


class Context(NamedTuple):
    """Where in a record the encoder is, for its errors, and whether values are raw."""

    path: str
    raw: bool

    def below(self, name: str) -> "Context":
        """Return the context of an item or field inside this one."""
        return Context(f"{self.path}/{name}", self.raw)

    def refuse(self, why: str) -> UsageError:
        """Return the error for what cannot be encoded here."""
        return UsageError(
            f"{self.path} cannot be encoded",
            why=why,
            next_step="compare with the names and widths in formats/asterix_items.json",
        )


def pack(
    shape: Shape, columns: dict[str, Any], dims: tuple[int, ...], octets: int, context: Context
) -> tuple[Octets, Flags]:
    """Write fields into (*dims, octets); return that and where any of them was given."""
    out = np.zeros((*dims, octets), np.uint8)
    present = np.zeros(dims, bool)
    for name, values in columns.items():
        try:
            field = shape.field(name)
        except KeyError:
            known = ", ".join(field.name for field in shape.fields if field.name)
            raise context.refuse(
                f"no field {name!r}; its fields: {known or '(one number)'}"
            ) from None
        numbers, given = _numbers(values, field, context.below(name) if name else context)
        present |= given
        _write_bits(out, np.broadcast_to(numbers, dims), field)
    return out, present


def _write_bits(out: Octets, numbers: NDArray[np.int64], field: Field) -> None:
    """Add non-negative numbers of `field.width` bits to the octets they lie in."""
    end = field.offset + field.width
    last = (end - 1) // 8
    rest = numbers.astype(np.uint64)
    shift = 8 * (last + 1) - end
    out[..., last] |= ((rest << np.uint64(shift)) & np.uint64(255)).astype(np.uint8)
    rest = rest >> np.uint64(8 - shift)
    for index in range(last - 1, field.offset // 8 - 1, -1):
        out[..., index] |= (rest & np.uint64(255)).astype(np.uint8)
        rest = rest >> np.uint64(8)


def _numbers(values: Any, field: Field, context: Context) -> tuple[NDArray[np.int64], Flags]:
    """Return what goes on the wire, without sign, and where it was given."""
    array, given = _given(values)
    if array.dtype.kind in "US":
        numbers = _from_text(array, field, context)
    elif field.is_quantity and not context.raw:
        numbers = np.rint(array.astype(np.float64) / field.lsb).astype(np.int64)
    else:
        numbers = array.astype(np.int64)
    low = -(1 << field.width - 1) if field.is_signed else 0
    high = (1 << field.width - field.is_signed) - 1
    if field.width < 64 and ((numbers < low) | (numbers > high))[given].any():
        wrong = array[given & ((numbers < low) | (numbers > high))].flat[0]
        raise context.refuse(
            f"{wrong} is outside {low * field.lsb:g} to {high * field.lsb:g} {field.unit}".rstrip()
        )
    mask = (1 << field.width) - 1 if field.width < 64 else -1
    return np.where(given, numbers & np.int64(mask), 0), given


def _given(values: Any) -> tuple[NDArray[Any], Flags]:
    """Return values without their absent ones (zero there), and where they were given."""
    mask = np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else False
    array = np.atleast_1d(np.ma.getdata(values) if mask is not False else np.asarray(values))
    if array.dtype.kind == "O":
        array = _without_none(array)
    if array.dtype.kind == "f":
        given = ~np.isnan(array)
        return np.where(given & np.logical_not(mask), array, 0), given & np.logical_not(mask)
    if array.dtype.kind in "US":
        return array, (np.strings.str_len(array) > 0) & np.logical_not(mask)
    return array, np.broadcast_to(np.logical_not(mask), array.shape)


def _without_none(array: NDArray[Any]) -> NDArray[Any]:
    """Turn a list with None into numbers with NaN, or into text with empty text."""
    if any(isinstance(value, (str, bytes)) for value in array.flat):
        return np.array([_as_text(value) for value in array.flat]).reshape(array.shape)
    return array.astype(np.float64)


def _as_text(value: Any) -> str:
    return value.decode("ascii") if isinstance(value, bytes) else value or ""


def _from_text(array: NDArray[Any], field: Field, context: Context) -> NDArray[np.int64]:
    """Pack text into a number; each different text once."""
    bits = {"c": 6, "a": 8, "o": 3}.get(field.kind)
    if bits is None:
        raise context.refuse(f"it is a number, not text such as {array.flat[0]!r}")
    texts, index = np.unique(array, return_inverse=True)
    packed = [_pack_text(_as_text(text), field, bits, context) for text in texts.tolist()]
    return np.array(packed, np.int64)[index].reshape(array.shape)


def _pack_text(text: str, field: Field, bits: int, context: Context) -> int:
    count = field.width // bits
    padded = text.rjust(count, "0") if field.kind == "o" else text.ljust(count)
    codes = [_code(letter, field.kind) for letter in padded]
    if len(codes) > count or None in codes:
        raise context.refuse(f"{text!r} does not fit {count} characters of its alphabet")
    number = 0
    for code in codes:
        number = number << bits | (code or 0)
    return number


def _code(letter: str, kind: str) -> int | None:
    if kind == "c":
        return _SIX_BIT.get(letter)
    if kind == "o":
        return int(letter) if letter in "01234567" else None
    return ord(letter) if ord(letter) < 256 else None


def as_rows(values: Any) -> Any:
    """Return values as a sequence: one value stands for all rows."""
    is_one = np.isscalar(values) or values is None or isinstance(values, (str, bytes))
    return [values] if is_one else values
