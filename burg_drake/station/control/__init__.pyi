from .ports import (
    export_driven_ports as export_driven_ports,
    export_ports as export_ports,
)
