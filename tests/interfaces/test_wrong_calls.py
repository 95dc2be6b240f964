"""Calls that are wrong in one way each: one clear error, made where the mistake was."""

import numpy as np
import pytest

import boresight as bs

LOOSE, PLANAR = (bs.ConstantVelocity(accel_mps2=0.5, dims=d) for d in (3, 2))
SITE = bs.Site(latitude_deg=41.0, longitude_deg=2.0, height_m=100.0)
MIRRORED = np.diag([1.0, 1.0, -1.0])

MODELS = {
    "axes too long": (lambda: bs.Pose(rotation=2.0 * np.eye(3)), "right angles"),
    "no axes": (lambda: bs.Pose(rotation=np.zeros((3, 3))), "right angles"),
    "left-handed": (lambda: bs.Pose(rotation=MIRRORED), "right-handed"),
    "planar axes": (lambda: bs.Pose(rotation=np.eye(2)), "rotation of a pose"),
    "axes not finite": (lambda: bs.Pose(rotation=np.full((3, 3), np.nan)), "rotation of a pose"),
    "planar place": (lambda: bs.Pose(position_m=[1.0, 2.0]), "position_m of a pose"),
    "endless place": (lambda: bs.Pose(position_m=[np.inf, 0, 0]), "three finite numbers"),
    "place in words": (lambda: bs.Pose(position_m="here"), "is not a number"),
    "sigma in words": (lambda: bs.Radar(range_m="thirty"), "range_m='thirty' is not a number"),
    "sigma without end": (lambda: bs.Radar(range_m=np.inf), "positive, finite"),
    "angle of turns": (lambda: bs.Radar(azimuth_deg=4000.0), "at most 180"),
    "nothing measured": (bs.Radar, "measures nothing"),
    "pose of another kind": (lambda: bs.Radar(range_m=1.0, pose=np.eye(3)), "is not a Pose"),
    "site of another kind": (lambda: bs.Radar(range_m=1.0, site=(1, 2, 3)), "pass site=bs.Site("),
    "noise without end": (lambda: bs.ConstantVelocity(accel_mps2=np.inf), "finite"),
    "noise in words": (lambda: bs.ConstantVelocity(accel_mps2="x"), "is not a number"),
    "dims no integer": (lambda: bs.ConstantVelocity(accel_mps2=1.0, dims=2.0), "neither 2 nor 3"),
    "offset in the plane": (
        lambda: bs.WithHeightOffset(inner=PLANAR, drift_m_per_sqrt_s=1.0),
        "no height to be offset",
    ),
    "coordinate not given": (lambda: bs.PositionSensor(x_m=None, y_m=1.0), "x_m=None"),
    "elevation in the plane": (
        lambda: bs.Radar(range_m=1, elevation_deg=1).components(PLANAR),
        "elevation_rad cannot see a motion in 2 dimensions",
    ),
    "height in the plane": (
        lambda: bs.Radar(range_m=1, height_m=1, site=SITE).components(PLANAR),
        "height_m cannot see a motion in 2 dimensions",
    ),
}


@pytest.mark.parametrize("name", MODELS)
def test_a_model_that_cannot_be_is_refused_when_it_is_made(name):
    call, said = MODELS[name]
    with pytest.raises(bs.UsageError, match=r"\n  (why|next): |neither 2 nor 3") as caught:
        call()
    assert said in str(caught.value)


def test_a_pose_takes_lists_of_whole_numbers():
    z = np.array([[[1000.0, 0.3, 0.2], [1010.0, 0.3, 0.2]]])
    means = []
    for pose in (
        bs.Pose(position_m=[1, 2, 3], rotation=[[0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
        bs.Pose(
            position_m=np.array([1.0, 2, 3]),
            rotation=np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
        ),
    ):
        radar = bs.Radar(range_m=10, azimuth_deg=1, elevation_deg=1, pose=pose)
        means.append(bs.run("ducm", LOOSE, radar, z, dt=1.0).mean)
    np.testing.assert_array_equal(*means)
