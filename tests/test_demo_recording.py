"""The shipped recording reads back: counts, physics, and the errors that were planted in it."""

from importlib.resources import as_file

import numpy as np
import polars as pl
import pytest
from scipy.interpolate import CubicSpline

from boresight.experiments import demo
from boresight.experiments.truth import Motion
from boresight.formats.asterix import decode
from boresight.formats.recording import read_recording
from boresight.formats.specs import edition
from boresight.maths import frames
from boresight.maths.angles import wrap
from oracles.demo_facts import FACTS, FOLDER, NM, PLANTED, RADAR, SITE, excess


@pytest.fixture(scope="module")
def truth():
    return demo.shipped()[1]


def blocks(category):
    """Start and end of the file's blocks of a category: category octet, then a length of two."""
    octets = np.frombuffer((FOLDER / "recording.ast").read_bytes(), np.uint8)
    found, at = [], 0
    while at < len(octets):
        length = int(octets[at + 1]) * 256 + int(octets[at + 2])
        if octets[at] == category:
            found.append((at, at + length))
        at += length
    assert at == len(octets)
    starts, ends = np.array(found).T
    return octets, starts, ends


@pytest.fixture(scope="module")
def records():
    editions = {category: FACTS["editions"][f"cat{category:03d}"] for category in (21, 34, 48)}
    return {
        category: decode(*blocks(category), edition(category, name))
        for category, name in editions.items()
    }


def one_a_scan(records):
    """Plots with an address, one a scan: where two stand in one scan, none."""
    plots = pl.DataFrame(
        {
            "time_s": records.value("140"),
            "address": records.raw("220", absent=-1),
            "type": records.raw("020/TYP"),
            "monitor": records.raw("020/RAB"),
            "range_m": records.value("040/RHO") * NM,
            "azimuth_deg": records.value("040/THETA"),
        }
    )
    plots = plots.filter(pl.col("address") >= 0, pl.col("type") > 0, monitor=0)
    plots = plots.sort("address", "time_s")
    before = pl.col("time_s").diff().over("address").fill_null(4.0)
    after = before.shift(-1).over("address").fill_null(4.0)
    return plots.filter(before > 2, after > 2)


def test_counts_are_those_stated(records):
    counts = FACTS["counts"]
    plots = records[48]
    for category in (21, 34, 48):
        assert len(records[category]) == counts[f"cat{category:03d}"]
        assert records[category].is_good.all()
    types = plots.raw("020/TYP")
    assert (types == 1).sum() == counts["clutter"]
    assert (types == 0).sum() == counts["coasted"]
    assert plots.raw("020/RAB").sum() == counts["monitor"]
    assert plots.flag("070/G").sum() == counts["mode_a_garbled"]
    assert plots.flag("090/G").sum() == counts["level_garbled"]
    other = counts["aircraft"] + counts["split"] + counts["reflection"]
    assert len(plots) == other + counts["clutter"] + counts["coasted"] + counts["monitor"]
    addresses = set(plots.raw("220", absent=-1).tolist()) - {-1}
    with_mode_s = [flight for flight in FACTS["flights"] if flight["address"]]
    assert len(addresses) == len(with_mode_s) + 1  # and the monitor


def test_sectors_come_in_turn_and_their_plots_lie_in_them(records):
    service = records[34]
    sector = service.value("020")
    np.testing.assert_allclose(sector, np.arange(len(sector)) % 32 * 11.25)
    np.testing.assert_array_equal(service.raw("000"), np.where(sector == 0, 1, 2))
    time = service.value("030") - FACTS["epoch_s"] - RADAR["time_bias_s"]
    np.testing.assert_allclose(time, np.arange(len(sector)) / 8, atol=1 / 250)
    assert service.has("050/MDS").sum() == RADAR["scans"]
    np.testing.assert_array_equal(np.unique(service.value("120/LAT")[sector == 0]), 47.8125)
    np.testing.assert_array_equal(np.unique(service.value("120/LON")[sector == 0]), 1.40625)
    plots = records[48]
    beam = (plots.value("140") - FACTS["epoch_s"] - RADAR["time_bias_s"]) / RADAR["scan_s"] * 360
    off = (plots.value("040/THETA") - beam + 180) % 360 - 180
    assert np.abs(off).max() < 5 * RADAR["azimuth_noise_deg"] + 0.75  # splits are up to 0.6 off


def test_two_share_a_mode_a_code_and_one_changes_its(records):
    plots = records[48]
    clear = (plots.raw("220", absent=-1) >= 0) & ~plots.flag("070/G") & plots.has("070")
    pairs = np.stack([plots.raw("220"), plots.raw("070/MODE3A")], axis=1)[clear]
    codes, addresses = np.unique(pairs, axis=0)[:, 1], np.unique(pairs, axis=0)[:, 0]
    assert (np.unique(codes, return_counts=True)[1] > 1).sum() == 1
    assert (np.unique(addresses, return_counts=True)[1] > 1).sum() == 1
    assert 0o6543 in codes
    without = plots.has("070") & ~plots.has("220")
    assert len(np.unique(plots.raw("070/MODE3A")[without & ~plots.flag("070/G")])) == 1


def design(plots, motion):
    """Residuals of range and azimuth, and their slopes in range, azimuth and time bias."""
    polar = frames.polar_from_enu(motion.position)
    east, north, _ = motion.position.T
    closing = np.sum(motion.position * motion.velocity, axis=1) / polar.range_m
    turning = (motion.velocity[:, 0] * north - motion.velocity[:, 1] * east) / (east**2 + north**2)
    height = frames.ellipsoid_height(*motion.position.T, SITE)
    range_left = plots["range_m"] - polar.range_m - excess(polar.range_m, height)
    azimuth_left = np.radians(plots["azimuth_deg"].to_numpy()) - polar.azimuth
    azimuth_left = np.degrees((azimuth_left + np.pi) % (2 * np.pi) - np.pi)
    zero, one = np.zeros(len(plots)), np.ones(len(plots))
    in_range = np.stack([one, zero, -closing], axis=1)
    in_azimuth = np.stack([zero, one, -np.degrees(turning)], axis=1)
    return (range_left.to_numpy(), in_range), (azimuth_left, in_azimuth)


def solve(plots, motion):
    """Weighted least squares; standard errors by the scatter of whole aircraft (sandwich)."""
    (r, A), (a, B) = design(plots, motion)
    sane = (np.abs(r - np.median(r)) < 200) & (np.abs(a - np.median(a)) < 0.5)
    sd_r, sd_a = np.std(r[sane]), np.std(a[sane])
    for _ in range(3):
        y = np.concatenate([r[sane] / sd_r, a[sane] / sd_a])
        X = np.concatenate([A[sane] / sd_r, B[sane] / sd_a])
        estimate = np.linalg.solve(X.T @ X, X.T @ y)
        left = y - X @ estimate
        half = len(left) // 2
        sd_r, sd_a = sd_r * np.std(left[:half]), sd_a * np.std(left[half:])
    flights = np.tile(plots["flight"].to_numpy()[sane], 2)
    scores = X * left[:, None]
    by_flight = np.stack([scores[flights == f].sum(axis=0) for f in np.unique(flights)])
    inverse = np.linalg.inv(X.T @ X)
    spread = np.sqrt(np.diag(inverse @ by_flight.T @ by_flight @ inverse))
    return estimate, spread, (sd_r, sd_a), half


def flight_numbers(plots):
    numbers = {int(f["address"], 16): i for i, f in enumerate(FACTS["flights"]) if f["address"]}
    keys = pl.DataFrame({"address": list(numbers), "flight": list(numbers.values())})
    return plots.join(keys, on="address", maintain_order="left")


def test_planted_biases_and_noise_come_back_against_the_truth(records, truth):
    plots = flight_numbers(one_a_scan(records[48]))
    delays = np.array([flight["transponder_delay_m"] for flight in FACTS["flights"]])
    plots = plots.with_columns(pl.col("range_m") - delays[plots["flight"].to_numpy()])
    motion = truth.at(plots["flight"].to_numpy(), plots["time_s"].to_numpy())
    estimate, spread, noise, count = solve(plots, motion)
    assert count > 8_000
    np.testing.assert_array_less(np.abs(estimate - PLANTED), 3 * spread)
    np.testing.assert_array_less(spread, [0.5, 0.0015, 0.004])
    quantum = np.array([NM / 256, 360 / 65_536]) / np.sqrt(12)
    expected = np.hypot([RADAR["range_noise_m"], RADAR["azimuth_noise_deg"]], quantum)
    np.testing.assert_allclose(noise, expected, rtol=3 / np.sqrt(2 * count))


def test_planted_biases_come_back_against_the_adsb_reports(records):
    """The reports that state their time and are accurate, between neighbours at most 5 s apart."""
    heard, plots = records[21], flight_numbers(one_a_scan(records[48]))
    good = heard.has("071") & (heard.raw("090/NACP") >= 8)
    place = frames.enu_from_geodetic(
        heard.value("131/LAT"), heard.value("131/LON"), heard.value("140") * 0.3048, SITE
    )
    parts, motions = [], []
    for (address,), mine in plots.group_by("address", maintain_order=True):
        rows = good & (heard.raw("080") == address)
        if rows.sum() < 30:
            continue
        time = heard.value("071")[rows]
        path = CubicSpline(time, place[rows])
        asked = mine["time_s"].to_numpy()
        after = np.clip(np.searchsorted(time, asked), 1, len(time) - 1)
        near = (asked > time[0]) & (asked < time[-1]) & (time[after] - time[after - 1] < 5)
        parts.append(mine.filter(near))
        motions.append(np.hstack([path(asked[near]), path(asked[near], 1)]))
    states = np.concatenate(motions)
    estimate, spread, _, count = solve(pl.concat(parts), Motion(states[:, :3], states[:, 3:]))
    assert count > 6_000
    np.testing.assert_array_less(np.abs(estimate - PLANTED), 3 * spread)
    np.testing.assert_array_less(spread, [2.5, 0.0015, 0.004])


@pytest.fixture(scope="module")
def tables():
    with as_file(FOLDER / "recording.ast") as path:
        return read_recording(path)


def test_the_reader_finds_what_the_builder_states(tables):
    assert tables.summary["skipped_bytes"] == 0
    assert tables.summary["damaged"] == []
    found = {entry["category"]: entry for entry in tables.summary["categories"]}
    for category, entry in found.items():
        assert entry["records"] == FACTS["counts"][f"cat{category:03d}"]
    assert found[48]["scan_s"] == pytest.approx(RADAR["scan_s"], abs=0.02)
    north = tables.sectors.filter(message="north")
    place = north.select("latitude_deg", "longitude_deg", "height_m").unique().rows()
    assert place == [(SITE.latitude_deg, SITE.longitude_deg, SITE.height_m)]


def test_the_monitor_scatters_by_the_planted_noise_about_the_planted_place(tables):
    monitor, scans = tables.plots.filter("fixed_transponder"), RADAR["scans"]
    assert monitor["address"].unique().to_list() == [RADAR["monitor"]["address"]]
    delay = excess(np.array([RADAR["monitor"]["range_m"]]), RADAR["monitor"]["height_m"])[0]
    expected = {
        "range_m": (RADAR["monitor"]["range_m"] + RADAR["range_bias_m"] + delay, 30.0),
        "azimuth_deg": (RADAR["monitor"]["azimuth_deg"] + RADAR["azimuth_bias_deg"], 0.08),
    }
    for name, (mean, sd) in expected.items():
        assert monitor[name].mean() == pytest.approx(mean, abs=3 * sd / np.sqrt(scans))
        assert monitor[name].std() == pytest.approx(sd, rel=3 / np.sqrt(2 * scans))


def test_pressure_height_and_height_are_apart_by_the_stated_law(tables):
    heard = tables.reference.filter(pl.col("height_m") > 0)
    offset = heard["height_m"] - 1.02 * heard["pressure_altitude_m"]
    assert offset.mean() == pytest.approx(35.0, abs=8.0)  # weather and GPS, some dozens of each
    assert (offset - 35.0).abs().max() < 12.0 + 5 * 5.0 + 8.0  # weather, GPS, quanta


def test_what_aircraft_say_of_themselves_is_what_they_do(tables, truth):
    said = tables.plots.filter(pl.col("roll_deg").is_not_null())
    keys = pl.DataFrame(FACTS["flights"]).with_row_index("flight").select("flight", "address")
    said = said.join(keys, on="address", maintain_order="left")
    motion = truth.at(said["flight"].to_numpy(), said["time_s"].to_numpy() - RADAR["time_bias_s"])
    azimuth = np.radians(said["azimuth_deg"].to_numpy())
    direct = np.abs(wrap(azimuth - frames.polar_from_enu(motion.position).azimuth)) < 0.02
    assert (~direct).sum() <= FACTS["counts"]["reflection"]  # these were said at another instant
    said, motion = said.filter(direct), Motion(*(part[direct] for part in motion))
    speed = np.hypot(motion.velocity[:, 0], motion.velocity[:, 1])
    track = np.arctan2(motion.velocity[:, 0], motion.velocity[:, 1])
    # North at the site and North at the aircraft differ by up to 1.5 degrees at 150 km.
    off = wrap(np.radians(said["true_track_deg"].to_numpy()) - track)
    assert np.degrees(np.abs(off)).max() < 2.0
    assert np.abs(said["ground_speed_mps"].to_numpy() - speed).max() < 2.0
    turning = said["roll_deg"].abs() > 20
    assert 200 < turning.sum() < 1_500


def test_each_adsb_fault_is_in_the_file_and_can_be_told(tables):
    names = {flight["address"]: flight["callsign"] for flight in FACTS["flights"]}
    heard = tables.reference
    late = heard.filter(time_kind="reception")["address"].unique().to_list()
    poor = heard.filter(pl.col("accuracy_m") > 500)["address"].unique().to_list()
    silent = set(names) - set(heard["address"].unique().to_list())
    assert sorted(names[address] for address in late) == FACTS["adsb"]["late"]
    assert sorted(names[address] for address in poor) == FACTS["adsb"]["poor"]
    assert sorted(names[address] for address in silent) == FACTS["adsb"]["without"]
