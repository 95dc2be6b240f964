"""Laws that every filter keeps, to hold your own filter to."""
