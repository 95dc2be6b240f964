"""From the scores of all runs to a study's result: averages, intervals, bands, comparisons.

`summarise(study, gathered)` takes one `scores.Gathered` for each of the study's cells, in their
order, and gives the `StudyResult` with an empty digest.
"""
