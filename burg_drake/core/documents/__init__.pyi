from .json_text import (
    DIGITS as DIGITS,
    load_json as load_json,
    parse_json as parse_json,
)
from .kinds import DOCUMENT_KINDS as DOCUMENT_KINDS
from .plain_yaml import (
    Tree as Tree,
    load_plain_yaml as load_plain_yaml,
    parse_plain_yaml as parse_plain_yaml,
)
from .ranges import (
    Ranges as Ranges,
    require_finite as require_finite,
    require_ranges as require_ranges,
    require_rising as require_rising,
)
from .reader import Reader as Reader
from .schema import (
    Pose as Pose,
    document_text as document_text,
    dump_document as dump_document,
    empty_document as empty_document,
    load_document as load_document,
    parse_document as parse_document,
    plain_data as plain_data,
    read_document as read_document,
    save_document as save_document,
)
from .schema_file import (
    json_schema as json_schema,
    schema_text as schema_text,
    write_schemas as write_schemas,
)
from .vectors import Vector3 as Vector3
from .yaml_events import (
    TAGS as TAGS,
    checked_events as checked_events,
)
from .yaml_nodes import (
    load_nodes as load_nodes,
    parse_nodes as parse_nodes,
)
