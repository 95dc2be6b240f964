"""Target motion analysis: from bearings and own ship's track to range, course and speed."""
