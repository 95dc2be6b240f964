"""What is in a recording, in numbers: gathered batch by batch, so that any length fits."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from boresight.formats.asterix import Records
from boresight.formats.columns import Floats, Stamp, sensor_name
from boresight.formats.decoding import Account
from boresight.formats.wire import Integers

_NORTH = 1
_ENOUGH = 64  # chunks that settle a scan period
_SHORTEST_SCAN_S = 0.3  # two reports of a target closer than this are one pass of the beam
# What tells one target (or sector) from another, first that is there.
_IDENTITY = {
    10: ("220", "161/TRK"),
    21: ("080",),
    34: ("020",),
    48: ("220", "070/MODE3A", "161/TRN"),
    62: ("040",),
}
_ADDRESS = {10: "220", 21: "080", 48: "220", 62: "380/ADR"}


@dataclass(slots=True)
class Source:
    """One sensor's records of one category so far."""

    edition: str
    records: int = 0
    first_s: float = np.inf
    last_s: float = -np.inf
    revisits_s: list[Floats] = field(default_factory=list)
    norths_s: list[Floats] = field(default_factory=list)


class Summary:
    """Gathers what `boresight inspect` prints."""

    def __init__(self) -> None:
        self._sources: dict[tuple[int, int], Source] = {}
        self._addresses: set[int] = set()
        self.report_types: Counter[int] = Counter()

    def add(self, records: Records, when: Stamp) -> None:
        """Take in one batch."""
        edition = records.edition
        who = _identity(records)
        for code in np.unique(when.sensor).tolist():
            rows = np.flatnonzero(when.sensor == code)
            source = self._sources.setdefault((edition.category, code), Source(edition.name))
            source.edition = edition.name
            _add(source, when.time_s[rows], who[rows])
            if edition.category == 34:
                norths = when.time_s[rows][records.raw("000")[rows] == _NORTH]
                source.norths_s.append(np.diff(norths))
        self._addresses |= _addresses(records)

    def categories(self) -> list[dict[str, Any]]:
        """Return one entry a category and sensor, as `boresight inspect --json` has them."""
        return [
            {
                "category": category,
                "edition": source.edition,
                "records": source.records,
                "sensor": sensor_name(code),
                "first_s": _finite(source.first_s),
                "last_s": _finite(source.last_s),
                "scan_s": self._scan(code, source),
            }
            for (category, code), source in sorted(self._sources.items())
        ]

    def report(self, account: Account) -> dict[str, Any]:
        """Return the whole object of `boresight inspect --json`."""
        return {
            "format": "asterix",
            "framing": account.framing,
            "bytes": account.bytes,
            "skipped_bytes": account.skipped,
            "categories": self.categories(),
            "addresses": len(self._addresses),
            "damaged": account.damaged,
            "unknown_categories": [
                {"category": category, "blocks": blocks}
                for category, blocks in sorted(account.unknown.items())
            ],
            "notes": notes(account),
        }

    def _scan(self, code: int, source: Source) -> float | None:
        """Return the scan period: from north marks of the same sensor, else from revisits."""
        service = self._sources.get((34, code), source)
        return _median(service.norths_s) or _median(source.revisits_s)


def _add(source: Source, times: Floats, who: Integers) -> None:
    source.records += len(times)
    known = ~np.isnan(times)
    if known.any():
        source.first_s = min(source.first_s, float(times[known].min()))
        source.last_s = max(source.last_s, float(times[known].max()))
    if len(source.revisits_s) < _ENOUGH:
        source.revisits_s.append(_revisits(times[known & (who >= 0)], who[known & (who >= 0)]))


def _revisits(times: Floats, who: Integers) -> Floats:
    """Return the time from one report of a target to its next."""
    order = np.lexsort((times, who))
    steps = np.diff(times[order])
    kept: Floats = steps[(np.diff(who[order]) == 0) & (steps > _SHORTEST_SCAN_S)]
    return kept


def _median(parts: list[Floats]) -> float | None:
    values = np.concatenate(parts) if parts else np.empty(0)
    return round(float(np.median(values)), 4) if len(values) else None


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _identity(records: Records) -> Integers:
    """Return a number that is the same for the same target; -1 where nothing tells."""
    who = np.full(len(records), -1, np.int64)
    for kind, path in enumerate(_IDENTITY[records.edition.category]):
        code = records.raw(path, absent=-1)
        # Kinds of identity are kept apart, so that a track number is never an address.
        who = np.where((who < 0) & (code >= 0), code | kind << 32, who)
    return who


def _addresses(records: Records) -> set[int]:
    path = _ADDRESS.get(records.edition.category)
    if path is None:
        return set()
    return set(np.unique(records.raw(path)[records.has(path)]).tolist())


def notes(account: Account) -> list[str]:
    """Return what a reader should know, in sentences."""
    found = [
        f"CAT{category:03d} of {sensor_name(code)}: editions {', '.join(choice.alike)} read alike, "
        f"{choice.edition.name} is named."
        for (category, code), choice in sorted(account.editions.items())
        if len(choice.alike) > 1 and category << 16 | code in account.good
    ]
    if account.trailing:
        found.append(
            f"{account.trailing} octets that a recorder appended to payloads are left out."
        )
    found += [
        f"{account.counts[kind]} {what}" for kind, what in _PACKETS.items() if account.counts[kind]
    ]
    if account.damaged_places > len(account.damaged):
        found.append(
            f"Of {account.damaged_places} damaged places {len(account.damaged)} are listed."
        )
    return found


_PACKETS = {
    "fragment packets": "IP fragments are not decoded.",
    "other packets": "packets hold something else than ASTERIX over UDP.",
    "cut packets": "packets were cut when they were captured.",
}
