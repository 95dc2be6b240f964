"""Schmidt's consider filter as it is printed: separate blocks, explicit inverses, one target.

Jazwinski (1970), section 8.4, after Schmidt (1966): x is estimated, b is not, z = H x + D b + v.
The covariances are propagated for the gain that is used, not by its optimality.
"""

import numpy as np


def predict(x, Pxx, Pxb, F, Q):
    """One step later; b stays."""
    return F @ x, F @ Pxx @ F.T + Q, F @ Pxb


def update(x, Pxx, Pxb, Pbb, z, H, D, R):
    """All components of a plot at once; NaN ones are cut out.

    Returns:
        x, Pxx, Pxb, normalised innovation squared.
    """
    there = ~np.isnan(z)
    z, H, D, R = z[there], H[there], D[there], R[np.ix_(there, there)]
    S = H @ Pxx @ H.T + H @ Pxb @ D.T + D @ Pxb.T @ H.T + D @ Pbb @ D.T + R
    K = (Pxx @ H.T + Pxb @ D.T) @ np.linalg.inv(S)
    A, nu = np.eye(len(x)) - K @ H, z - H @ x
    cross = A @ Pxb @ D.T @ K.T
    cov = A @ Pxx @ A.T - cross - cross.T + K @ (D @ Pbb @ D.T + R) @ K.T
    return x + K @ nu, cov, A @ Pxb - K @ D @ Pbb, nu @ np.linalg.inv(S) @ nu
