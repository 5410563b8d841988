"""The comparison: cross validation, tasks, results, suites, tuning."""
