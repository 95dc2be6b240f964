"""What is wrong with a sensor, found against a reference and said with its uncertainty."""
