"""YAML documents: their kinds, and JSON Schemas by which editors complete and check them."""

from burg_drake.core import (
    DOCUMENT_KINDS as DOCUMENT_KINDS,
    json_schema as json_schema,
    write_schemas as write_schemas,
)
