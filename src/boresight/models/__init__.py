"""The world as frozen data: motions, sensors and what they measure, the air."""
