"""The selection and the view of a page, as parameters."""
