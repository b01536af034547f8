from .grasp_files import (
    FORMATS as FORMATS,
    format_by_suffix as format_by_suffix,
    format_of as format_of,
    read_grasp_file as read_grasp_file,
    write_grasp_file as write_grasp_file,
)
