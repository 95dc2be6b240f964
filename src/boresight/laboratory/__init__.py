"""The laboratory: filters compared over many runs of a world, and how far to trust the verdict."""
