"""A dataset at a glance: a page of thumbnails with filters, a contact sheet."""
