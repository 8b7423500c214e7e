"""One form of export a file; `FORMS` of the folder above lists them."""
