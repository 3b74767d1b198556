"""Analysis of finished runs from recordings and ring logs: timeline, comparison, figures, report page, exports."""
