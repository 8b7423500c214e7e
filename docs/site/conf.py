"""What Sphinx needs to know to build the site; `build.py` calls it."""

project = "flawforge"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "furo"
html_title = "flawforge"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_copyright = False
html_copy_source = False
exclude_patterns = ["flaws/cost.md"]
nitpicky = False
default_role = "code"  # docstrings write `name`
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]
autodoc_typehints = "signature"
autodoc_mock_imports = ["torch"]  # an extra that the site must not need
autodoc_member_order = "bysource"
python_use_unqualified_type_names = True
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_rtype = False
