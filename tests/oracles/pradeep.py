"""pradeep in plain NumPy: relative state [vx vy Rx Ry], x East and y North, angles from true North.

What is printed wrongly stands beside what was meant, chosen by name. Leading axes are runs. Own
ship after 150 s is not the paper's: it turns on to 270, and back to 090 from 540 s on.
"""

import numpy as np

RANGE_M, BEARING, COURSE = 4000.0, np.radians(45.0), np.radians(120.0)
TARGET, OWN_SHIP = 15.45, 10.30  # printed as knots
SIGMA = np.radians(0.33)
SECONDS = 800
OURS = [3, 2, 1, 0]  # where [North, East, their rates] stand in the paper's state


def wrap(angle):
    return np.arctan2(np.sin(angle), np.cos(angle))


def heading(angle):
    """East and North of a unit step on a true course."""
    return np.stack([np.sin(angle), np.cos(angle)], axis=-1)


def own_ship(speed, seconds=SECONDS, *, early=0):
    """(seconds + 1, 2): each second is sailed on the course that holds at its beginning.

    `early` turns the ship before the move instead.
    """
    k = np.arange(seconds) + early
    course = 90.0 - np.clip(3.0 * (k - 120), 0.0, 180.0) + np.clip(3.0 * (k - 540), 0.0, 180.0)
    moves = speed * heading(np.radians(course))
    return np.concatenate([np.zeros((1, 2)), np.cumsum(moves, axis=0)])


def target(speed, seconds=SECONDS):
    """(seconds + 1, 2): straight on."""
    k = np.arange(seconds + 1)[:, None]
    return RANGE_M * heading(BEARING) + speed * k * heading(COURSE)


def range_and_bearing(relative):
    return np.hypot(*relative.T), np.arctan2(*relative.T)


def measured(relative, runs, seed):
    """(runs, steps) bearings with noise: (iv)."""
    generator = np.random.default_rng(seed)
    _, bearing = range_and_bearing(relative)
    return wrap(bearing + SIGMA * generator.standard_normal((runs, len(relative))))


def transition(t):
    """Phi and Gamma of (iii)."""
    phi, gamma = np.eye(4), np.zeros((4, 2))
    phi[2:, :2] = t * np.eye(2)
    gamma[:2], gamma[2:] = t * np.eye(2), t * t / 2 * np.eye(2)
    return phi, gamma


def moved_by(own, k):
    """b(k+1)."""
    return np.concatenate([np.zeros(2), -(own[k + 1] - own[k])])


def row(last, *places):
    """A row with nothing for the velocities."""
    zero = np.zeros(np.shape(last))
    return np.stack([zero, zero, *places, last], axis=-1)


def gradient(X, form="corrected"):
    """H of (v); printed, as far as it can be read, the squared range is not below the line."""
    x, y = X[..., 2], X[..., 3]
    square = x * x + y * y
    factor = square if form == "printed" else 1 / square
    return row(-x * factor, y * factor)


def gain(bearing, X, form):
    """G of (x): `printed`, `small angle` without the sine too many, or `exact`."""
    x, y = X[..., 2], X[..., 3]
    s, c = np.sin(bearing), np.cos(bearing)
    along = x * s + y * c
    if form == "printed":
        return row(-s / along, c * s / along)
    turn = wrap(bearing - np.arctan2(x, y))
    safe = np.where(turn == 0.0, 1.0, turn)
    exact = np.where(turn == 0.0, 1.0, safe / np.tan(safe))
    factor = 1.0 if form == "small angle" else exact
    return row(-s * factor / along, c * factor / along)


def outer(a, b):
    return a[..., :, None] * b[..., None, :]


def difference(z, X, *, wrapped=True):
    """Measured less foreseen bearing: (viii), with erratum P5."""
    nu = z - np.arctan2(X[..., 2], X[..., 3])
    return wrap(nu) if wrapped else nu


def corrected(P, G, g, sigma):
    """(ix)."""
    A = np.eye(4) - outer(G, g)
    return A @ P @ np.swapaxes(A, -1, -2) + sigma**2 * outer(G, G)


def update(X, P, z, form, sigma=SIGMA, *, wrapped=True, bounded=False):
    """(vii) to (ix): H in the gain, g in the covariance; `ekf` has H in both.

    `bounded`, which the paper does not have: H also where g would make the trace of P^-1 P+ more
    than four.

    Returns:
        State, covariance, innovation and its variance.
    """
    H, nu = gradient(X), difference(z, X, wrapped=wrapped)
    S = np.einsum("...i,...ij,...j->...", H, P, H) + sigma**2
    G = np.einsum("...ij,...j->...i", P, H) / S[..., None]
    after = corrected(P, G, H if form == "ekf" else gain(z, X, form), sigma)
    if bounded:
        grown = np.trace(np.linalg.solve(P, after), axis1=-2, axis2=-1) > 4.0
        after = np.where(grown[..., None, None], corrected(P, G, H, sigma), after)
    return X + G * nu[..., None], after, nu, S


def track(z, own, X, P, form, *, accel=0.0, **settings):
    """One filter: (iii), (vi) to (x), the first bearing at the start.

    Args:
        z: (..., steps) bearings.
        own: (steps, 2) East and North, a second apart.
        X: (..., 4) and P (..., 4, 4) before the first bearing.
        form: `ekf`, or one of `gain`.
        accel: standard deviation of each of the two plant noises.
        settings: of `update`.

    Returns:
        States (..., steps, 4), covariances, innovations and their variances (..., steps).
    """
    phi, gamma = transition(1.0)
    told = []
    for k in range(z.shape[-1]):
        if k:
            X = X @ phi.T + moved_by(own, k - 1)
            P = phi @ P @ phi.T + accel**2 * gamma @ gamma.T
        X, P, nu, S = update(X, P, z[..., k], form, **settings)
        told.append((X, P, nu, S))
    X, P, nu, S = zip(*told, strict=True)
    return np.stack(X, -2), np.stack(P, -3), np.stack(nu, -1), np.stack(S, -1)


def start(bearing, middle, spread, speed_sd, sigma=SIGMA):
    """On a bearing, with the spread of range and bearing turned to it; the paper is silent."""
    bearing = np.broadcast_to(bearing, np.broadcast_shapes(np.shape(bearing), np.shape(middle)))
    along = heading(bearing)
    across = np.stack([along[..., 1], -along[..., 0]], axis=-1)
    zero = np.zeros(np.shape(bearing))
    X = np.stack([zero, zero, middle * along[..., 0], middle * along[..., 1]], axis=-1)
    P = np.zeros((*np.shape(bearing), 4, 4))
    P[..., :2, :2] = speed_sd**2 * np.eye(2)
    for sd, axis in ((spread, along), (middle * sigma, across)):
        P[..., 2:, 2:] += outer(np.asarray(sd)[..., None] * axis, np.asarray(sd)[..., None] * axis)
    return X, P


def log_likelihood(nu, S, form="corrected"):
    """Of (xii); printed, the exponential stands below the line."""
    sign = 1.0 if form == "printed" else -1.0
    return -0.5 * np.log(2 * np.pi * S) + sign * 0.5 * nu**2 / S


def weights(loglik):
    """(xi) from equal weights, without pruning: (..., steps, cells), all at once."""
    total = np.cumsum(loglik, axis=-2)
    share = np.exp(total - np.max(total, axis=-1, keepdims=True))
    return share / np.sum(share, axis=-1, keepdims=True)


def mixture(share, X, P):
    """Mean and covariance of weighted cells, the cell's axis last but that of the state."""
    mean = np.einsum("...c,...ci->...i", share, X)
    apart = X - mean[..., None, :]
    return mean, np.einsum("...c,...cij->...ij", share, P + outer(apart, apart))


def sustained(ok):
    """First step from which on a criterion holds to the end; the number of steps for never."""
    steps = ok.shape[-1]
    return np.where(ok.all(axis=-1), 0, steps - np.argmin(ok[..., ::-1], axis=-1))


def within(X, relative, speed_limit):
    """Whether range, bearing, course and speed are all within "error that is tolerated"."""
    true_range, true_bearing = range_and_bearing(relative)
    far, bearing = np.hypot(X[..., 2], X[..., 3]), np.arctan2(X[..., 2], X[..., 3])
    course, speed = np.arctan2(X[..., 0], X[..., 1]), np.hypot(X[..., 0], X[..., 1])
    return (
        (abs(far / true_range - 1) <= 0.1)
        & (abs(wrap(bearing - true_bearing)) <= np.radians(0.5))
        & (abs(wrap(course - COURSE)) <= np.radians(5.0))
        & (abs(speed - TARGET) <= speed_limit)
    )
