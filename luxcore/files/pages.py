"""HTML pages from Jinja templates, whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2

from luxcore.files.atomic import atomic_file


def write_page_from(template: Path, path: Path, **values: Any) -> Path:
    """Fill `template` with `values`, escaped, into `path`, which is returned.

    A name that the template uses and `values` lacks is an error. The template may include its
    neighbours.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(template.parent),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = environment.get_template(template.name).render(values)
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path
