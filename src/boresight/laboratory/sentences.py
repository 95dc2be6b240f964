"""What is to be said of a contender, a sentence for each fact: figure, interval, what it means."""

import math
from collections.abc import Iterator

from boresight.laboratory.result import Cell, Interval
from boresight.laboratory.study import Study

HELPED = "a bias or a start better than was assumed must help it"
PATH = "the path is given, and is smoother than the process noise that the bound assumes"


def verdicts(study: Study, cell: Cell) -> tuple[str, ...]:
    """Sentences on a cell: its error, its lost runs, whether it knows its errors, and the rest."""
    percent = f"{100 * (1 - study.false_alarm):g} %"
    parts = [_error(study, cell, percent), _lost(cell, percent), _anees(study, cell, percent)]
    parts += [_anis(cell, percent), *_bias(cell, percent), *_further(cell, percent)]
    return tuple(f"{cell.label} {part}" for part in parts if part)


def doubts(study: Study, cell: Cell) -> tuple[str, ...]:
    """Those of the sentences that speak against a cell."""
    percent = f"{100 * (1 - study.false_alarm):g} %"
    low, high = cell.anees_bounds
    parts = [
        "" if math.isfinite(cell.position_rmse_m.value) else _error(study, cell, percent),
        _lost(cell, percent) if cell.diverged.value else "",
        "" if low <= cell.anees.value <= high else _anees(study, cell, percent),
        _anis(cell, percent),
        *_bias(cell, percent),
    ]
    return tuple(f"{cell.label} {part}" for part in parts if part)


def number(x: float) -> str:
    """Three figures, thousands parted by commas; in a word what is none."""
    if math.isfinite(x):
        return f"{float(f'{x:.3g}'):,.10g}"
    return "unknown" if math.isnan(x) else "infinite"


def _in(x: Interval, percent: str, unit: str = "") -> str:
    """Render `(99 % interval 40.8 to 41.6 m)`; nothing where it is not told."""
    if not math.isfinite(x.high):
        return ""
    return f" ({percent} interval {number(x.low)} to {number(x.high)}{unit})"


def _error(study: Study, cell: Cell, percent: str) -> str:
    error = cell.position_rmse_m
    if not math.isfinite(error.value):
        return "has an infinite position RMSE: in at least one run its estimate is not a number."
    words = f"has a position RMSE of {number(error.value)} m{_in(error, percent)}"
    if math.isfinite(cell.ratio_to_bound):
        words += f", {cell.ratio_to_bound:.3f} times the Cramér-Rao bound of "
        words += f"{number(cell.pcrlb_m)} m{_give_or_take(cell)}"
    if error.high < cell.pcrlb_m:
        is_given = study.settings[cell.setting].scenario.path is not None
        words += f": {PATH if is_given else HELPED}"
    return f"{words}; it takes {number(cell.ns_per_step)} ns a step."


def _give_or_take(cell: Cell) -> str:
    """How uncertain the bound is, as it is that of some trajectories."""
    error = cell.extra.get("pcrlb_standard_error_m", math.nan)
    return f" (standard error {number(error)} m)" if math.isfinite(error) else ""


def _lost(cell: Cell, percent: str) -> str:
    share, count = cell.diverged, round(cell.diverged.value * cell.runs)
    if not count:
        return f"diverged in none of {cell.runs:,} runs (share below {_share(share.high)})."
    return (
        f"diverged in {count:,} of {cell.runs:,} runs ({_share(share.value)}, {percent} interval "
        f"{_share(share.low)} to {_share(share.high)}): they are in the RMSE; the median run is at "
        f"{number(cell.median_rmse_m)} m."
    )


def _share(x: float) -> str:
    return f"{float(f'{100 * x:.2g}'):g} %"


def _anees(study: Study, cell: Cell, percent: str) -> str:
    low, high = cell.anees_bounds
    if math.isnan(cell.anees.value):
        return ""
    if not math.isfinite(cell.anees.value):
        return "does not know its errors: in at least one run its covariance is none."
    where = (
        f"ANEES {cell.anees.value:.3f}, a consistent filter lies within {low:.3f} to {high:.3f} in "
        f"{percent} of studies"
    )
    shared = [what for what in ("truth", "noise") if getattr(study, what) == "one"]
    if shared:
        where += f" where runs do not share one {' and one '.join(shared)}, as these do"
    factor = math.sqrt(cell.anees.value)
    if cell.anees.value > high:
        return f"is too sure of itself: {where}; its errors are {factor:.3f} times its claims."
    if cell.anees.value < low:
        return f"is too modest: {where}; its errors are {factor:.3f} times its claims."
    return f"knows its errors: {where}."


def _anis(cell: Cell, percent: str) -> str:
    low, high = cell.anis_bounds
    if not math.isfinite(cell.anis) or low <= cell.anis <= high:
        return ""
    words = "more" if cell.anis > high else "less"
    return (
        f"is surprised {words} by plots than it expects: average NIS {cell.anis:.3f} per measured "
        f"number, a consistent filter lies within {low:.3f} to {high:.3f} in {percent} of studies."
    )


def _bias(cell: Cell, percent: str) -> Iterator[str]:
    found = cell.extra
    away = found.get("bias_standard_errors", 0.0)
    if found.get("bias_limit", math.inf) < away < math.inf:
        share = away / math.sqrt(cell.runs)
        yield (
            f"is biased: at scan {found['bias_scan']} its mean position error is "
            f"{number(found['bias_m'])} m, {number(away)} standard errors "
            f"(without bias below {number(found['bias_limit'])} at all scans in {percent} of "
            f"studies) and {number(share)} of one run's standard deviation."
        )


def _further(cell: Cell, percent: str) -> Iterator[str]:
    found = cell.extra
    if "ratio_to_exact" in found:
        ratio: Interval = found["ratio_to_exact"]
        yield (
            f"has {ratio.value:.3f} times the error of the exact posterior at the last scan"
            f"{_in(ratio, percent)}: {number(found['final_rmse_m'])} m on the runs where that has "
            f"{number(found['exact_final_m'])} m."
        )
    if "noncredibility_db" in found:
        yield (
            f"has a noncredibility index of {number(found['noncredibility_db'])} dB, where errors "
            f"drawn from its own claims have {number(found['noncredibility_credible_db'])} dB, and "
            f"an inclination of {number(found['inclination_db'])} dB (positive: too sure)."
        )
    if "converged" in found:
        share: Interval = found["converged"]
        when = found["convergence_s"]
        middle = f"the median run after {number(when)} s" if math.isfinite(when) else "most did not"
        yield (
            f"converged in {_share(share.value)} of runs ({percent} interval {_share(share.low)} "
            f"to {_share(share.high)}); {middle}."
        )
    if "gospa_m" in found:
        yield (
            f"has a GOSPA of {number(found['gospa_m'].value)} m"
            f"{_in(found['gospa_m'], percent)}; the target was missed in "
            f"{_share(found['missed'])} of scans, and {_share(found['false'])} had a false track."
        )
