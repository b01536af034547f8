from .atomic import (
    UNFINISHED as UNFINISHED,
    atomic_write as atomic_write,
    atomic_write_all as atomic_write_all,
    keep_mode as keep_mode,
    open_regular as open_regular,
    remove_unfinished as remove_unfinished,
    require_writable as require_writable,
    writable_folder as writable_folder,
)
from .bounded_text import (
    DOCUMENT as DOCUMENT,
    GRASP_FILE as GRASP_FILE,
    IMAGE_SIZE as IMAGE_SIZE,
    TABLE as TABLE,
    Limits as Limits,
    read_bytes as read_bytes,
    read_pipe as read_pipe,
    read_rows as read_rows,
    read_text as read_text,
)
from .decimal_text import (
    format_rows as format_rows,
    rounded_to_places as rounded_to_places,
)
from .hdf5 import (
    Hdf5File as Hdf5File,
    is_hdf5 as is_hdf5,
    open_hdf5 as open_hdf5,
)
from .lock import (
    FolderLock as FolderLock,
    try_lock as try_lock,
    without_locks as without_locks,
)
from .numpy_file import (
    NpzFile as NpzFile,
    npy_shape as npy_shape,
    open_npy as open_npy,
    open_npz as open_npz,
    write_npy as write_npy,
)
from .read_errors import (
    READ_ERRORS as READ_ERRORS,
    reporting_read_errors as reporting_read_errors,
    short_message as short_message,
    without_warnings as without_warnings,
)
from .stored_array import (
    NUMBERS as NUMBERS,
    ArrayShape as ArrayShape,
    ReadBudget as ReadBudget,
    StoredArray as StoredArray,
    require_grasps as require_grasps,
    text_array as text_array,
)
