"""What the commands' options are called, mean, and default to, as their help shows them."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from boresight.interfaces import contacts, door

File = Annotated[Path, Parameter(help="ASTERIX recording (raw, pcap, ...), CSV or Parquet.")]
Strict = Annotated[
    bool,
    Parameter(
        negative="", show_default=False, help="Stop at the first damage instead of skipping it."
    ),
]
Columns = Annotated[
    str | None, Parameter(help="For a table, its columns as OURS=THEIRS,... (range_m=rng,...).")
]
Site = Annotated[
    str | None,
    Parameter(
        allow_leading_hyphen=True,
        help="Place of the sensor as LAT,LON,H: degrees, degrees, metres above the ellipsoid. "
        "Left out: what the radar says of itself (CAT034), if it does.",
    ),
]
Air = Annotated[
    str | None,
    Parameter(
        show_default=lambda _: "none",
        help="The air whose delay is taken out of the ranges: none, effective-earth, exponential.",
    ),
]
Filters = Annotated[
    list[str] | None,
    Parameter(
        negative="",
        show_default=lambda _: door.FILTER,
        help="Which filter: see boresight cite. Several, or all, are compared on the same plots; "
        "the tracks are those of the first.",
    ),
]
Output = Annotated[Path, Parameter(alias="-o", help="Folder for report.html and the tables.")]
Figures = Annotated[
    Path | None, Parameter(alias="-o", help="Folder for the figures and a page of all.")
]

# Of target motion analysis.
BearingsFile = Annotated[
    Path,
    Parameter(
        help="Bearings: CSV or Parquet (time_s, bearing_deg; sigma_deg, conical, track), or a "
        "MATLAB file of time differences."
    ),
]
OwnShip = Annotated[
    Path,
    Parameter(
        help="Own ship's track: time_s and latitude_deg, longitude_deg or north_m, east_m; "
        "course_deg, speed_mps, heading_deg if there are any."
    ),
]
MotionFilter = Annotated[
    str | None,
    Parameter(
        show_default=lambda _: contacts.FILTER,
        help="A bank (rp-ekf, rp-mgekf, rp-ukf, rp-ckf, rp-modified-polar) or a single filter "
        "(mgekf, modified-polar, ekf, ...): see boresight cite.",
    ),
]
Ranges = Annotated[
    str | None,
    Parameter(
        show_default=lambda _: "1000,20000",
        help="Between which ranges the contact may be, m: NEAREST,FARTHEST.",
    ),
]
CellCount = Annotated[
    int | None,
    Parameter(show_default=lambda _: "12", help="How many range cells a bank has."),
]
Overlap = Annotated[
    float | None,
    Parameter(
        show_default=lambda _: "1.5",
        help="How wide a cell begins, over the spread of a uniform range in it. The paper's bank "
        "is --cells 6 --overlap 1.",
    ),
]
Prune = Annotated[float | None, Parameter(help="Share of the weight below which a cell goes.")]
Speed = Annotated[
    float | None,
    Parameter(help="What is believed of the contact's velocity: m/s, a standard deviation."),
]
Contact = Annotated[
    str | None, Parameter(help="One contact of a file with several; left out, all.")
]
Sigma = Annotated[
    float | None,
    Parameter(
        help="Standard deviation of a bearing, degrees, where the file does not tell; left "
        "out, estimated from the scatter."
    ),
]
Degrees = Annotated[
    bool,
    Parameter(
        negative="",
        show_default=False,
        help="The bearings are degrees, though they look like radians.",
    ),
]
Declination = Annotated[
    float | None,
    Parameter(
        allow_leading_hyphen=True,
        help="Makes magnetic bearings true: degrees, east positive.",
    ),
]
OwnShipClock = Annotated[
    float,
    Parameter(allow_leading_hyphen=True, help="Seconds to add to own ship's times."),
]
Tow = Annotated[
    float, Parameter(help="Metres that the array is towed behind own ship, along its path.")
]
Spacing = Annotated[
    float | None,
    Parameter(help="Metres between two hydrophones, for a table of time differences (tdoa_s)."),
]
SoundSpeed = Annotated[
    float | None,
    Parameter(
        show_default=lambda _: "1500",
        help="Speed of sound, m/s, for time differences; left out, what the file says.",
    ),
]
Limits = Annotated[
    str | None,
    Parameter(
        show_default=lambda _: "range=10,bearing=0.5,course=5,speed=1.03,confidence=0.9",
        help="When the answer has converged: range in per cent, degrees, degrees, m/s, and how "
        "sure one must be.",
    ),
]
BearingColumns = Annotated[
    str | None,
    Parameter(help="The bearings' columns as OURS=THEIRS,... (time_s=t,bearing_deg=brg,...)."),
]
OwnShipColumns = Annotated[
    str | None, Parameter(help="The same for own ship's table (latitude_deg=lat,...).")
]
Acceleration = Annotated[
    float,
    Parameter(
        help="How unsteadily the contact may move: m/s², a standard deviation; 0 for a steady "
        "course and speed."
    ),
]
PositionError = Annotated[
    float,
    Parameter(
        help="How well own ship's track is known, m: what wanders by as much is no manoeuvre."
    ),
]

# Of the laboratory.
StudyFile = Annotated[
    Path, Parameter(help="A study.toml: scenario, sensor, filters, and what is swept.")
]
Runs = Annotated[int | None, Parameter(help="Runs of each cell, instead of the study's.")]
Seed = Annotated[int | None, Parameter(help="Seed, instead of the study's.")]
Engine = Annotated[
    Literal["threads", "processes", "dask", "local"],
    Parameter(
        help="What does the work: threads of this process (local is the same), processes of this "
        "machine, or a Dask cluster. The numbers are the same."
    ),
]
Workers = Annotated[
    int | None,
    Parameter(show_default=lambda _: "all cores", help="How many threads or processes."),
]
Scheduler = Annotated[
    str | None, Parameter(help="Of the Dask cluster: tcp://host:port, for --engine dask.")
]
Chunk = Annotated[int | None, Parameter(help="Runs done at once; the numbers do not depend on it.")]
Resume = Annotated[
    bool,
    Parameter(
        negative="",
        show_default=False,
        help="Go on with what the folder given by -o holds of an interrupted study.",
    ),
]
StudyFolder = Annotated[
    Path | None,
    Parameter(
        alias="-o",
        help="Folder for report.html and the tables of cells, runs and scans; finished chunks are "
        "kept there too, for --resume.",
    ),
]
Simulated = Annotated[Path, Parameter(alias="-o", help="Folder for the tables.")]
