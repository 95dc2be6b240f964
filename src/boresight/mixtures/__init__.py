"""Several Gaussians for one target."""
