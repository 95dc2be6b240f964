"""What the errors and references of a calibration are, in a reader's words."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from boresight.calibration.result import Calibration

# What a positive and a negative error do, to a reader.
MEANING = {
    "range_bias_m": ("ranges are too long", "ranges are too short"),
    "range_gain_m_per_km": ("ranges grow too fast", "ranges grow too slowly"),
    "azimuth_bias_deg": ("azimuths are too far clockwise", "azimuths are too far anticlockwise"),
    "time_bias_s": ("plots are stamped too late", "plots are stamped too early"),
    "elevation_bias_deg": ("elevations are too high", "elevations are too low"),
    "site_east_m": (
        "the antenna stands east of its stated place",
        "the antenna stands west of its stated place",
    ),
    "site_north_m": (
        "the antenna stands north of its stated place",
        "the antenna stands south of its stated place",
    ),
}
REFERENCES = {
    "adsb": "The reference is ADS-B: where aircraft say they are, mostly by satellite navigation. "
    "An error common to all of them would be taken for the radar's.",
    "system tracks": "The reference is a tracker's system tracks, and these are not the truth: "
    "errors here are relative to them. If this radar feeds that tracker, the tracks carry some of "
    "its errors, and what is found is less than what is wrong. A track also lags in turns.",
    "table": "The reference is a table of positions; errors here are relative to it, and known "
    "no better than it.",
    "downlink": "There is no position reference: straight stretches of flight, as the radar sees "
    "them, are held against the true track that the aircraft send down. That shows a rotation of "
    "the whole picture, so the azimuth bias, and nothing of range or time.",
}
NAMES = {"adsb": "ADS-B", "downlink": "downlinked tracks", "table": "a table of positions"}


def unit(calibration: "Calibration") -> str:
    """What is compared: pairs of a plot and a position or, without those, straight stretches."""
    return "stretches" if calibration.reference == "downlink" else "pairs"


def meaning(calibration: "Calibration", reason: str) -> str:
    """Why plots of a reason made no pair, in words; nothing where the reason says all."""
    from boresight.calibration.downlink_reports import MEANINGS as OF_DOWNLINK
    from boresight.calibration.matching import MEANINGS as OF_PAIRING

    own = OF_DOWNLINK if calibration.reference == "downlink" else {}
    return (OF_PAIRING | own).get(reason, "")
