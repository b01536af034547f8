from .bop import write_bop as write_bop
from .card import (
    CARD as CARD,
    write_card as write_card,
)
from .coco import write_coco as write_coco
from .graspnet import (
    write_graspnet as write_graspnet,
)
from .sample_view import show_sample as show_sample
from .sheet import (
    contact_sheet as contact_sheet,
    sample_caption as sample_caption,
    spread as spread,
)
from .source import (
    Samples as Samples,
)
from .webdataset import write_webdataset as write_webdataset
